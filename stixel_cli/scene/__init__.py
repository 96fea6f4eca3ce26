"""The 3-D scene: road users, paths, the ego car, the world and the ground truth."""
