"""The 3-D scene: road users, paths, the ego car, ground truth, and the renderers."""
