"""``pneumarm coverage``."""
