"""What `gp_ekf` adds to [GP] for a sensor that sees one side of a target of a known class.

The points of [GP] are on the contour, all round it, and all are the target's. A camera or a lidar
sees the near side alone, less than the outline of a class (`contour/class_shape.py`), and its
neighbours. A small contour can fit such points with its far side, or grow into a neighbour.
"""

from dataclasses import replace
from statistics import median
from typing import Literal

import numpy as np

from stixel_cli.geometry.pose import rotation
from stixel_cli.tracking.contour.class_shape import class_shape, visible_shape, visible_table
from stixel_cli.tracking.contour.contour_rays import Rays, rays_of, segments
from stixel_cli.tracking.contour.ray_table import expected, outline_table
from stixel_cli.tracking.gp_ekf_update import SEEN, linearise
from stixel_cli.tracking.kalman import correct
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.prior import PriorShape, prior_radii

FARTHEST = 1.0
"""Greatest shift of a point along its ray, m."""

REACH, REACH_BESIDE = 0.5, 0.3
"""A point this near the contour, m, is the target's: of the segment of neighbouring rays on which
the contour was placed, and of other segments. Inside the contour it may be twice as far."""

OUTSIDE = 0.6
"""No point of the target is farther outside the outline of its class, m."""

PLACING_STD, TAIL, LOOSE = 0.1, 0.3, 4.0
"""To place the contour on a segment: standard deviation of a point and scale of its heavy tail, m;
factor on the covariance of the pose."""

SIDE_SHARE = 0.8
"""Of the standard deviation of a point: that of the error which all ranges of a scan share."""

NEAREST_RAY = 0.1
"""Corners of the contour this near to a ray, m, are what it meets."""


class OneSide:
    """A sensor that sees one side of the targets of a `prior`, from their points alone if unknown.

    Attributes:
        radii: (N,) m at the angles of the `process`: of the class's outline in the prior's size, or
            of the prior's shape if the class is unknown.
    """

    def __init__(
        self,
        prior: PriorShape,
        seen_by: Literal["stixels", "fabricated", "lidar", "file", "own"],
        process: ContourProcess,
    ):
        self._process = process
        self._known = prior.road_user != "unknown"
        self._tables = None
        self.radii = prior_radii(prior, process.basis_angles)
        if not self._known:
            return
        shape = class_shape(prior.road_user)
        self._factors = np.log(np.array([prior.length, prior.width]) / shape.size)
        outline = shape.outline * np.exp(self._factors)
        bearings = np.arctan2(outline[:, 1], outline[:, 0])
        lengths = np.hypot(*outline.T)
        self.radii = np.interp(process.basis_angles, bearings, lengths, period=2.0 * np.pi)
        if seen_by in ("stixels", "lidar"):
            seen = visible_shape(prior.road_user, seen_by)
            visible = visible_table(shape.outline, seen, blurred=seen_by == "stixels")
            self._tables = visible, outline_table(shape.outline)
            self._bias_per_std = seen.bias_per_std

    def rays(
        self,
        points_world: np.ndarray,
        covariances: np.ndarray,
        sensor: np.ndarray,
        pose: np.ndarray,
    ) -> Rays:
        """The rays of points (n, 2) m, moved to where they would be if the outline were seen.

        `covariances` (n, 2, 2) m² are the points'; `sensor` and `pose` (3,) the poses of the sensor
        and of the target in the world. Points of an unknown class stay.
        """
        rays = rays_of(points_world, covariances, sensor)
        if self._tables is not None and len(points_world):
            state = np.concatenate([pose, self._factors])[None]
            visible, outline = (
                expected(state, sensor[:2], rays.directions, -1, -1, *table.arrays())[0][0]
                for table in self._tables
            )
            missed = np.clip(visible - outline, -FARTHEST, FARTHEST)
            missed += self._bias_per_std * rays.stds
            rays = replace(rays, ranges=rays.ranges - missed)
        return rays

    def target(
        self, rays: Rays, candidates: np.ndarray, mean: np.ndarray, covariance: np.ndarray
    ) -> np.ndarray:
        """Of the `candidates` (m,), indices of rays, those whose points fit the contour.

        The contour at `mean` (6 + N,) is first placed on one segment of neighbouring rays, that
        with most points near it, by a robust fit of the pose: a target that turns or brakes has
        all of its points elsewhere, a neighbour has not.
        """
        model = linearise(rays.points_world[candidates], mean, self._process)
        labels = segments(rays)[candidates]
        weights = 1.0 / (1.0 + (model.residuals / TAIL) ** 2)
        main = labels == np.bincount(labels, weights).argmax()
        slopes = model.radial_matrix[:, :SEEN]
        residuals = model.residuals
        loose = LOOSE * covariance[:SEEN, :SEEN]
        for _ in range(2):
            # The noise of a Cauchy distribution, at the last residuals.
            noise = PLACING_STD**2 * (1.0 + (residuals[main] / TAIL) ** 2)
            step, posterior, _ = correct(loose, slopes[main], noise, model.residuals[main])
            residuals = model.residuals - slopes @ step
        variances = ((slopes @ posterior) * slopes).sum(axis=1)
        stds = np.sqrt(np.maximum(variances, 0.0))
        reach = np.where(main, REACH + stds, REACH_BESIDE)
        inside = (residuals < reach) & (residuals > -2.0 * reach)
        if self._known:
            placed = mean[:SEEN] + step
            inside &= self._outside(rays.points_world[candidates], placed) < OUTSIDE
        return candidates[inside]

    def _outside(self, points_world: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """How far points (n, 2) m are outside the class's outline at a `pose` (3,), m."""
        offsets = points_world - pose[:2]
        angles = np.arctan2(offsets[:, 1], offsets[:, 0]) - pose[2]
        basis = self._process.basis_angles
        return np.hypot(*offsets.T) - np.interp(angles, basis, self.radii, period=2.0 * np.pi)

    def near_side(
        self, rays: Rays, indices: np.ndarray, mean: np.ndarray, covariance: np.ndarray, std: float
    ) -> np.ndarray:
        """The `mean` (6 + N,), moved so that its near side meets the points at `indices` (m,).

        By the gain of one range, the median of the distances behind the contour, whose error is a
        share of `std` m. The update uses the points again, so the covariance (6 + N, 6 + N) stays.
        """
        if not len(indices):
            return mean
        directions = rays.directions[indices]
        turn = rotation(mean[2])
        radii = np.maximum(mean[2 * SEEN :], 0.0)
        contour = mean[:2] - rays.sensor[:2]
        contour = contour + (radii[:, None] * self._process.basis_directions) @ turn.T
        along = directions @ contour.T
        across = np.abs(rays.normals[indices] @ contour.T)
        met = across < np.maximum(NEAREST_RAY, across.min(axis=1, keepdims=True) + 0.03)
        behind = median((rays.ranges[indices] - np.where(met, along, np.inf).min(axis=1)).tolist())
        direction = directions.mean(axis=0)
        direction /= np.hypot(*direction)
        spread = covariance[:, :2] @ direction
        return mean + spread / (direction @ spread[:2] + (SIDE_SHARE * std) ** 2) * behind
