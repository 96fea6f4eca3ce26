"""Sweeps: many points as one graph, with tables and figures over all of them."""
