"""The greatest IoU of the outline that a star-convex contour can have, such as `gp_ekf`'s."""

import numpy as np

from stixel_cli.scene.scenario import Scenario

RAYS = 720
"""Rays from the centre along which the best star-convex contour is sought."""

LIMB_SAMPLES = 4
"""Poses of the limbs, even in their cycle, that the upper bound is the mean over."""


def star_convex_upper_bound(scenario: Scenario) -> float:
    """The mean over `LIMB_SAMPLES` poses of the limbs; NaN where the outline is unknown."""
    if scenario.only_box or not scenario.known.any():
        return np.nan
    contours = scenario.contours_target
    chosen = contours[:: max(1, len(contours) // LIMB_SAMPLES)]
    return float(np.mean([best_star_convex_iou(contour) for contour in chosen]))


def best_star_convex_iou(contour: np.ndarray) -> float:
    """The greatest IoU of the polygon `contour` (M, 2) m with a shape that is star-convex about 0.

    Such a shape has one radius along each ray. With the areas I inside and O outside the polygon
    and its area A, the IoU is I / (A + O). Its maximum is the s at which the greatest I - s (A + O)
    is 0 (Dinkelbach 1967, *On nonlinear fractional programming*), and that sum has its greatest
    value along each ray on its own.
    """
    angles = 2.0 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    start, end = contour, np.roll(contour, -1, axis=0)
    # An edge is met where its ends are on different sides of the ray's line, in front of it.
    normals = np.stack([-directions[:, 1], directions[:, 0]], axis=-1)
    a, b = normals @ start.T, normals @ end.T
    along = directions @ start.T, directions @ end.T
    crossed = (a < 0.0) != (b < 0.0)
    weight = np.divide(a, a - b, out=np.zeros_like(a), where=crossed)
    ranges = along[0] + weight * (along[1] - along[0])
    ranges = np.where(crossed & (ranges > 0.0), ranges, np.inf)
    ranges = np.sort(ranges, axis=1)[:, : int((np.isfinite(ranges)).sum(axis=1).max())]
    # A ray from inside the polygon leaves it first; one from outside enters it first.
    inside = np.isfinite(ranges).sum(axis=1) % 2 == 1
    half = 0.5 * np.where(np.isfinite(ranges), ranges, 0.0) ** 2
    sign = np.where(np.arange(half.shape[1]) % 2 == 0, 1.0, -1.0) * np.where(inside, 1, -1)[:, None]
    leaves = np.isfinite(ranges) & (sign > 0.0)
    within = np.cumsum(sign * half, axis=1)
    outside = half - within
    area = float(np.where(leaves, within, 0.0).max(axis=1).sum())
    share = 0.0
    for _ in range(20):
        gains = np.where(leaves, within - share * outside, -np.inf)
        best = np.argmax(gains, axis=1)
        rows = np.arange(RAYS)
        used = gains[rows, best] > 0.0
        found = within[rows, best][used].sum() / (area + outside[rows, best][used].sum())
        if found <= share:
            break
        share = float(found)
    return share
