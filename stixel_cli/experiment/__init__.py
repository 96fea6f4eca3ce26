"""Experiments: stages put together, run, and written to result folders."""
