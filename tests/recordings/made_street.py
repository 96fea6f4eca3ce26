"""A small street whose images and disparities are exact: textured planes, seen from any place."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stixel_cli.geometry.rig import Rig

HALF_WIDTH = 5.0
"""From the middle of the street to the walls on both sides, m."""

END = 60.0
"""Of the street, at a wall across it, m."""


def street_rig(**changes) -> Rig:
    values = {"width": 320, "height": 128, "horizontal_fov": None, "vertical_fov": None}
    values |= {"focal_length": 260.0, "principal_u": 158.0, "principal_v": 56.0}
    values |= {"baseline": 0.5, "camera_height": 1.6, "pitch": 0.0}
    return Rig(**values | changes)


def view(rig: Rig, pose: np.ndarray, boxes=()) -> tuple[np.ndarray, np.ndarray]:
    """Grey image (H, W) uint8 and depth (H, W) m of a camera.

    Args:
        rig: of the camera.
        pose: (3, 4) in the frame x right, y down, z ahead, with the road at y = camera height.
        boxes: faces (x from, x to, z, height) m on the road, across it; a fifth value, True,
            makes one without texture.
    """
    v, u = np.mgrid[: rig.height, : rig.width].astype(float)
    rays = np.stack([(u - rig.u0) / rig.focal, (v - rig.v0) / rig.focal_v, np.ones_like(u)], -1)
    rays = rays @ pose[:, :3].T
    origin = pose[:, 3]
    best = np.full(u.shape, np.inf)
    places = np.zeros((*u.shape, 2))
    planes = [(1, rig.camera_height, 0, 2, None)]
    planes += [(0, side, 1, 2, None) for side in (-HALF_WIDTH, HALF_WIDTH)]
    planes += [(2, END, 0, 1, None), *((2, box[2], 0, 1, box) for box in boxes)]
    for number, (axis, at, one, other, limits) in enumerate(planes):
        with np.errstate(divide="ignore", invalid="ignore"):
            away = (at - origin[axis]) / rays[..., axis]
        away = np.where(np.isfinite(away), away, -1.0)
        hit = origin + away[..., None] * rays
        seen = (away > 0.1) & (away < best)
        if limits is not None:
            low, high, _, top, *plain = limits
            seen &= (hit[..., 0] >= low) & (hit[..., 0] <= high)
            seen &= (hit[..., 1] <= rig.camera_height) & (hit[..., 1] >= rig.camera_height - top)
            hit = 0.0 * hit if any(plain) else hit
        best = np.where(seen, away, best)
        pattern = np.stack([hit[..., one], hit[..., other]], -1) + 17.3 * number
        places = np.where(seen[..., None], pattern, places)
    return np.clip(np.rint(128.0 + 110.0 * texture(places)), 0, 255).astype(np.uint8), best


def texture(places: np.ndarray) -> np.ndarray:
    """Smooth noise (…,) in about -1 … 1 at `places` (…, 2) m: waves of many lengths."""
    random = np.random.default_rng(5)
    value = np.zeros(places.shape[:-1])
    for length in (0.35, 0.5, 0.8, 1.3, 2.1, 3.4, 5.5):
        for _ in range(3):
            angle, phase = random.uniform(0.0, 2.0 * np.pi, 2)
            along = places @ np.array([np.cos(angle), np.sin(angle)])
            value += np.sin(2.0 * np.pi * along / length + phase)
    return value / 6.0


def stereo_view(rig: Rig, pose: np.ndarray, boxes=()) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Left and right image (H, W) uint8, and the disparity (H, W) px of the left one.

    The right camera is displaced so that disparities have the `rig`'s error.
    """
    left, depth = view(rig, pose, boxes)
    disparity = rig.disparity_from_depth(depth)
    right_pose = pose.copy()
    right_pose[:, 3] = pose[:, 3] + rig.baseline * pose[:, 0]
    right, right_depth = view(replace(rig, principal_u=rig.u0_right), right_pose, boxes)
    if any(rig.disparity_error):
        # A pixel u of a right image without error is seen at u - e, by the left image's column.
        u = np.arange(rig.width, dtype=float)
        columns = u + rig.disparity_from_depth(right_depth)
        error = rig.disparity_error_basis(columns.ravel()) @ rig.disparity_error
        moved = u + error.reshape(columns.shape)
        rows = zip(moved, right, strict=True)
        right = np.rint([np.interp(at, u, row) for at, row in rows]).astype(np.uint8)
    return left, right, disparity


def poses_ahead(count: int, step: float, sway: float = 0.0) -> np.ndarray:
    """Poses (count, 3, 4) of a camera that drives ahead by `step` m and turns by `sway` rad."""
    poses = np.zeros((count, 3, 4))
    yaws = sway * np.sin(np.arange(count))
    poses[:, :, :3] = Rotation.from_euler("y", yaws[:, None]).as_matrix()
    poses[:, 2, 3] = step * np.arange(count)
    return poses
