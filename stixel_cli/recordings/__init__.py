"""Recordings of real cameras: images, calibration, labels, poses; one module per layout."""
