"""Measurements of the target: scans of points on the world's ground plane."""
