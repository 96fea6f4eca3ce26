"""Experiments in extended target tracking on stixels."""

__version__ = "0.1.0"
