"""Pixels and disparities of camera points, and back, as a reference for tests."""

import numpy as np

from stixel_cli.geometry.rig import Rig


def project(rig: Rig, points_camera: np.ndarray) -> np.ndarray:
    """Pixel and disparity (n, 3) = (u, v, d) in px of camera points (n, 3) in m, thesis (3)."""
    x, y, z = np.moveaxis(np.asarray(points_camera, dtype=np.float64), -1, 0)
    u = rig.focal * x / z + rig.u0
    v = rig.focal_v * y / z + rig.v0
    return np.stack([u, v, rig.disparity_from_depth(z)], axis=-1)


def unproject(rig: Rig, measurements: np.ndarray) -> np.ndarray:
    """Camera points (n, 3) in m of measurements (n, 3) = (u, v, d) in px, thesis (5)."""
    u, v, disparity = np.moveaxis(np.asarray(measurements, dtype=np.float64), -1, 0)
    z = rig.depth_from_disparity(disparity)
    x = (u - rig.u0) * z / rig.focal
    y = (v - rig.v0) * z / rig.focal_v
    return np.stack([x, y, z], axis=-1)


def nearest_of(rig: Rig, end: int) -> float:
    """The least depth, m, for which all disparities below `end` px are searched."""
    return rig.focal * rig.baseline / (end - 1.5)
