"""Recordings of real cameras: images, calibration, labels, poses; one module per layout.

What reads a file raises UserError if it is missing, damaged, or lacks what is asked for: one line
that names the file, the row and the cause.
"""
