"""The version of pneumarm, which stores keep with every run."""

__version__ = "0.1.0"
