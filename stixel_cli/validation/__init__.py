"""Errors of the pipeline's stages and of points against the rendered truth."""
