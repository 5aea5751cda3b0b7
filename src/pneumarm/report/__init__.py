"""The report: figures of one style, and a self-contained page of a run."""
