"""Sweeps: many runs as one graph, with tables and figures over all of them."""
