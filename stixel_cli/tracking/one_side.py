"""What `gp_ekf` adds to [GP] for a sensor that sees one side of a target of a known class.

The points of [GP] are on the contour, all round it, and all are the target's. A camera or a lidar
sees the near side alone, less than the outline of a class (`contour/class_shape.py`), and its
neighbours. A small contour can fit such points with its far side, or grow into a neighbour.

The gain of `gp_ekf` takes neighbouring points for independent ones, with a noise that stands for
what they share. Its covariance is too large where the errors are small, and too small where they
are shared. What is stated is that of the same estimate with the errors that are there
(`consider.py`): the points' own noise, the size of the class, the shape that the sensor sees, in
which road users differ and limbs swing, and what a target's faces are off at its points' heights.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from stixel_cli.geometry.kernel import first_hits
from stixel_cli.geometry.pose import rotation
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.association import GATE_STDS, uncut
from stixel_cli.tracking.background import Background
from stixel_cli.tracking.consider import JointCovariance
from stixel_cli.tracking.contour.class_shape import HEIGHTS, MODE_ANGLES, class_shape, outline_modes
from stixel_cli.tracking.contour.contour_rays import (
    FACES,
    Rays,
    rays_of,
    sight_of,
)
from stixel_cli.tracking.contour.ray_kernels import expected
from stixel_cli.tracking.contour.ray_table import outline_table
from stixel_cli.tracking.gp_ekf_update import Linearisation, linearise, update
from stixel_cli.tracking.kernel import ContourProcess
from stixel_cli.tracking.loop import Scan
from stixel_cli.tracking.prior import PriorShape, prior_radii

if TYPE_CHECKING:
    from stixel_cli.tracking.gp_ekf import GpEkfParameters

REACH = 0.5
"""A point this near the contour, m, is the target's. All of the segment of neighbouring rays that
has most points near it are: a target that turns or brakes has all of its points elsewhere."""

END_SHARE = 0.17
"""Of the prior's width: standard deviation of the places of the first and the last point at the
ends of the outline."""


class OneSide(JointCovariance):
    """A sensor that sees one side of the targets of a `prior`, from their points alone if unknown.

    And the joint covariance of the state of `gp_ekf` and of the errors that it considers.

    Attributes:
        radii: (N,) m at the angles of the `process`: of the class's outline in the prior's size, or
            of the prior's shape if the class is unknown.
        radii_covariance: (N, N) m², of the class's sizes; of the process if unknown.
        shape_covariance: (N, N) m², of how far radii of this size may be off: shapes of the class,
            its limbs, and the roughness. Reported alone: in a scan the visible shape contains it.
        roughness: m, root mean square of what the process leaves out of the class's outline: its
            corners and wheels are sharper.
    """

    def __init__(
        self,
        prior: PriorShape,
        tracker: "GpEkfParameters",
        process: ContourProcess,
        scans: Scans,
        initial: np.ndarray,
    ):
        """From the covariance (6, 6) `initial` of the start."""
        self._process, self._field_of_view, shared = process, scans.field_of_view, 0
        self._background, self._sight = Background(), None
        self._variance = tracker.measurement_std**2
        self.radii = prior_radii(prior, process.basis_angles)
        self.radii_covariance, self.shape_covariance = process.covariance, 0.0 * process.covariance
        self._std_factor, self.roughness, self._end_std = 1.0, 0.0, END_SHARE * prior.width
        if prior.road_user != "unknown":
            self._know_class(prior, tracker)
            shared = FACES * (scans.heights is not None and self._sight.height_insets is not None)
        super().__init__(block_diag(initial, self.radii_covariance), shared)

    def _know_class(self, prior: PriorShape, tracker: "GpEkfParameters") -> None:
        """Outline, sizes, shapes and visible shape of the class of the `prior`."""
        process, shape = self._process, class_shape(prior.road_user)
        self._factors = np.log(np.array([prior.length, prior.width]) / shape.size)
        self._outline = outline = shape.outline * np.exp(self._factors)
        lengths = np.hypot(*outline.T)
        self.radii = self._radii(outline)
        smooth, _ = process.regression(process.correlations(outline / lengths[:, None]))
        self.roughness = float(np.sqrt(np.mean((smooth @ self.radii - lengths) ** 2)))
        modes = outline_modes(prior.road_user)
        angles = 2.0 * np.pi * np.arange(MODE_ANGLES) / MODE_ANGLES
        shapes = np.stack([self._at(angles, one) for one in (*modes.fixed, *modes.limbs)])
        self.shape_covariance = shapes.T @ shapes + self.roughness**2 * np.eye(len(self.radii))
        # One standard deviation longer, and wider.
        larger = np.exp(np.diag([prior.length_std, prior.width_std]))
        sizes = np.stack([self._radii(outline * one) for one in larger]) - self.radii
        self.radii_covariance = sizes.T @ sizes
        self._sight = sight = sight_of(prior.road_user, tracker)
        self._tables = sight.table, outline_table(shape.outline)
        self._std_factor = sight.std_factor

    def _radii(self, outline: np.ndarray) -> np.ndarray:
        """Radii (N,) m of an `outline` (n, 2) m at the basis angles."""
        return self._at(np.arctan2(outline[:, 1], outline[:, 0]), np.hypot(*outline.T))

    def _contour(self, mean: np.ndarray) -> np.ndarray:
        """The contour (N, 2) m in the world at the basis angles, of the state `mean` (6 + N,)."""
        corners = np.maximum(mean[6:], 0.0)[:, None] * self._process.basis_directions
        return mean[:2] + corners @ rotation(mean[2]).T

    def _at(self, bearings: np.ndarray, values: np.ndarray) -> np.ndarray:
        """`values` (n,) at the `bearings` (n,) rad of an outline, at the basis angles (N,)."""
        return np.interp(self._process.basis_angles, bearings, values, period=2.0 * np.pi)

    @property
    def reported(self) -> np.ndarray:
        """Covariance (6 + N, 6 + N) of pose, rates, and radii of this target in this moment."""
        reported = self.matrix[: self.size, : self.size].copy()
        reported[6:, 6:] += self.shape_covariance
        return reported

    def rays(self, scan: Scan, mean: np.ndarray) -> tuple[Rays, np.ndarray]:
        """The rays of the points of a scan, moved to where they would be if the outline were seen.

        `mean` (6 + N,) is the target's state. Points of an unknown class stay. Also (2, n) m: how
        far inside the outline's ends those of the visible shape are, and the standard deviations of
        the moves.
        """
        sensor, seen = scan.sensor, (scan.covariances, scan.sensor, self._field_of_view)
        rays = rays_of(scan.points, *seen, scan.heights)
        spread = GATE_STDS * np.sqrt(max(np.trace(self.matrix[:2, :2]), 0.0))
        others = self._background.others(rays, mean[:2], mean[6:].max() + spread)
        if self._sight is None or not len(scan.points):
            return replace(rays, others=others), np.zeros((2, len(scan.points)))
        state = np.concatenate([mean[:3], self._factors])
        if scan.heights is not None and self._sight.height_insets is not None:
            moves, shared = self._outwards(rays, mean)
            rays = rays_of(scan.points + moves, *seen, scan.heights)
            rays = replace(rays, shared=shared)
        visible, outline = (
            expected(state, sensor, rays.directions, table.arrays) for table in self._tables
        )
        missed = visible[0] - outline[0] + self._sight.bias_per_std * rays.stds
        insets = np.stack([visible[1] - outline[1], visible[2]])
        return replace(rays, others=others, ranges=rays.ranges - missed), insets

    def _outwards(self, rays: Rays, mean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far points (n, 2) m are moved to where they would be if they were low.

        A windscreen is behind the bumper, a roof is narrower. Each moves from the face of the
        target's section at its height that is nearest, straight outwards, at most to the outline: a
        point that moves along an oblique ray gets from the front to the side. With how far one
        standard deviation of the ends' and of the sides' insets moves it (n, 2, 2) m.
        """
        turn, half = rotation(mean[2]), np.abs(self._outline).max(axis=0)
        sensor, points = ((one - mean[:2]) @ turn for one in (rays.sensor[:2], rays.points_world))
        rear, front, sides = self._sight.height_insets
        means, stds = (
            np.stack([np.interp(rays.heights, HEIGHTS, one) for one in both], axis=-1)
            for both in zip(front if sensor[0] > 0.0 else rear, sides, strict=True)
        )
        outwards, planes = -np.sign(rays.directions @ turn), half - means
        face = np.abs(outwards * points - planes).argmin(axis=1)[:, None] == [0, 1]
        normals = outwards * face
        starts = np.clip(points, -0.95 * half, 0.95 * half) + 2.0 * half.max() * normals
        profile = (starts * normals).sum(axis=1) - first_hits(self._outline, starts, -normals)
        moves = np.clip(profile - planes[face], 0.0, means[face])
        return (moves[:, None] * normals) @ turn.T, -(outwards * stds)[:, None] * turn

    def target(self, rays: Rays, candidates: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """Of the `candidates` (m,), indices of rays, those that are the target's at `mean`."""
        candidates = candidates[~rays.others[candidates]]
        if not len(candidates):
            return candidates
        labels = rays.labels[candidates]
        off = np.abs(linearise(rays.points_world[candidates], mean, self._process).residuals)
        main = np.bincount(labels, 1.0 / (1.0 + (off / REACH) ** 2)).argmax()
        # A segment that is mostly elsewhere has other objects', too.
        whole = 2 * np.sum(labels == main) >= np.sum(rays.labels == main)
        return candidates[(labels == main) & whole | (off < REACH)]

    def linearised(self, rays: Rays, mean: np.ndarray) -> Linearisation:
        """The model of the points of `rays`, at the places where they most likely were.

        At a noisy point itself the radius and its slope are those of another place: with noise of
        half of the target's size the near side moves away. So each is taken between where its ray
        meets the contour and the point, by the variances along the ray of the target's place and of
        the point, at most half way to the centre: beyond it the far side fits as well. The residual
        is that of the point, linear from there.
        """
        directions, contour = rays.directions, self._contour(mean)
        ranges = first_hits(contour, np.full_like(directions, rays.sensor[:2]), directions)
        of_position = ((directions @ self.matrix[:2, :2]) * directions).sum(axis=1)
        share = of_position / (of_position + (self._std_factor * rays.stds) ** 2)
        behind = np.where(np.isfinite(ranges), ranges - rays.ranges, 0.0)
        deep = 0.5 * max(mean[6:].min(), 0.0)
        moved = (behind - np.clip(share * behind, -deep, deep))[:, None] * directions
        model = linearise(rays.points_world + moved, mean, self._process)
        return replace(model, residuals=model.residuals - (model.gradients * moved).sum(axis=1))

    def between_ends(
        self, rays: Rays, insets: np.ndarray, mean: np.ndarray, covariance: np.ndarray
    ) -> np.ndarray:
        """The `mean` (6 + N,), moved across the rays so that its ends are those of the points.

        Or as far outside of them as the `insets` (n,) m of the visible shape. Ranges hardly measure
        the place across the rays, and the slope of a narrow target's radius holds for a few degrees
        only. An end at the border of the field of view, or beside a nearer object, is not used.
        """
        ends = np.array([rays.bearings.argmin(), rays.bearings.argmax()])
        seen = uncut(rays.bearings[ends], rays.ranges[ends], rays.field_of_view)
        seen &= ~np.array(rays.hidden)
        if len(rays.ranges) < 2 or not seen.any():
            return mean
        directions, share = rays.directions, seen / seen.sum()
        ahead = directions.sum(axis=0) / np.hypot(*directions.sum(axis=0))
        left = np.array([-ahead[1], ahead[0]])
        offsets = self._contour(mean) - rays.sensor[:2]
        depths = offsets @ ahead
        places = offsets @ left / depths
        farthest = np.array([places.argmin(), places.argmax()])
        places, depths = places[farthest], depths[farthest]
        apart = (directions[ends] @ left / (directions[ends] @ ahead) - places) * depths
        offset = share @ (apart + np.array([-1.0, 1.0]) * insets[ends])
        # What moves an end by 1 m: across its ray, which is not quite across the others.
        row = np.zeros(len(mean))
        row[:2] = share @ (left - places[:, None] * ahead)
        # As if only the place were wrong: the ends do not tell a turn from a shift.
        spread = covariance[:, :2] @ row[:2]
        gain = spread / (row[:2] @ spread[:2] + self._end_std**2)
        self.correct_by_one(gain, row, self._end_std**2)
        return mean + gain * offset

    def correct_by_scan(
        self, mean: np.ndarray, covariance: np.ndarray, rays: Rays, moves: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Mean (6 + N,) and covariance of the gain after the points of `rays`, and the NIS.

        `moves` (2, n) m are how far inside the ends of the outline those of the visible shape are,
        and the standard deviations of the visible shape.
        """
        insets, shape_stds = moves
        mean = self.between_ends(rays, insets, mean, covariance)
        model = self.linearised(rays, mean)
        gradients, (matrix, variances) = model.gradients, model.rows
        along = (gradients * rays.directions).sum(axis=1)
        squares = (gradients**2).sum(axis=1)
        own = (self._std_factor * rays.stds * along) ** 2
        mean, covariance, gain, _ = update(mean, covariance, model, self._variance + own, False)
        own += variances + self.roughness**2 * squares
        own += (squares - along**2) * rays.across_variances
        # Neighbours share the error of the visible shape, as far as they share the radius.
        between = model.directions_target @ model.directions_target.T - 1.0
        noise = np.exp(between / self._process.length_scale**2, out=between)
        noise *= np.outer(shape_stds * along, shape_stds * along)
        noise.flat[:: len(own) + 1] += own
        shared = (gradients[:, None] @ rays.shared)[:, 0]
        rows, residuals = np.hstack([matrix, shared]), model.residuals
        spread = self.correct(gain, rows, gain @ noise) @ rows.T + noise
        return mean, covariance, float(residuals @ np.linalg.solve(spread, residuals))
