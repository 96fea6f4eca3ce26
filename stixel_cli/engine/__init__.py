"""A graph of cached stages, computed by workers."""
