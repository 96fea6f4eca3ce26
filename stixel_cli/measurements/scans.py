"""Scans, the input of every tracker, from any sensor; and the errors that all of them share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, pose_rates, rotation, wrap_angle

BEARING = np.radians(0.1)
"""Points with heights are of one bearing within this, rad: half of the step of common lidars."""

BEHIND = 2.0
"""Of two returns of one bearing, m: farther apart they are of two objects."""


@dataclass(frozen=True)
class SharedErrors:
    """Standard deviations of errors that stay the same over all scans; 0 or empty: there is none.

    A point's own covariance does not contain them. A tracker cannot average them out: they are
    added to what it states, see `tracking.track:with_sensor_errors`.

    Attributes:
        disparity: independent errors of a stereo rig's disparity, each three coefficients, 1/m, of
            (1, x, x²), with x the tangent of the bearing to the right: the depth z changes by z²
            times this polynomial. They are the columns of a root of the coefficients' covariance,
            px², divided by the focal length times the baseline, px m.
        range_bias: of all ranges, m.
        position: of the sensor's x and of its y in the world, m.
        heading: of the sensor's heading, rad.
        time: of the times of the sensor's poses, s: they are the poses of another moment.
    """

    disparity: tuple[tuple[float, float, float], ...] = ()
    range_bias: float = 0.0
    position: float = 0.0
    heading: float = 0.0
    time: float = 0.0

    @property
    def count(self) -> int:
        """Number m of independent errors."""
        single = (self.range_bias, self.position, self.position, self.heading, self.time)
        return len(self.disparity) + sum(std > 0.0 for std in single)

    def directions(
        self, points_world: np.ndarray, sensor_pose: np.ndarray, sensor_rates: np.ndarray
    ) -> np.ndarray:
        """How points (n, 2) m move by one standard deviation of each error: (n, 2, m) m.

        `sensor_pose` (3,) is the sensor's pose in the world, `sensor_rates` (3,) its rates, m/s and
        rad/s.
        """
        offsets = points_world - sensor_pose[:2]
        right, depth = (offsets @ rotation(sensor_pose[2] - STRAIGHT_AHEAD)).T
        turned = np.stack([-offsets[:, 1], offsets[:, 0]], axis=-1)
        moved = []
        for coefficients in self.disparity:
            # The point stays on its ray, so all of its offset grows as the depth does.
            tangent = right / np.maximum(depth, 1e-9)
            growth = depth * np.polynomial.polynomial.polyval(tangent, coefficients)
            moved.append(growth[:, None] * offsets)
        if self.range_bias > 0.0:
            ranges = np.maximum(np.hypot(*offsets.T), 1e-9)
            moved.append(self.range_bias * offsets / ranges[:, None])
        if self.position > 0.0:
            moved += [np.tile(self.position * axis, (len(offsets), 1)) for axis in np.eye(2)]
        if self.heading > 0.0:
            moved.append(self.heading * turned)
        if self.time > 0.0:
            moved.append(self.time * (sensor_rates[:2] + sensor_rates[2] * turned))
        return np.stack(moved, axis=-1) if moved else np.zeros((len(offsets), 2, 0))

    def pose_shifts(
        self, pose: np.ndarray, sensor_pose: np.ndarray, sensor_rates: np.ndarray
    ) -> np.ndarray:
        """How a target at `pose` (3,) is moved and turned, as its points are: (3, m) m and rad.

        The other arguments are those of `directions`.
        """
        triangle = pose[:2] + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        here, ahead, left = self.directions(triangle, sensor_pose, sensor_rates)
        return np.vstack([here, 0.5 * ((ahead - here)[1] - (left - here)[0])])


NO_SHARED_ERRORS = SharedErrors()
"""Of a sensor that is exact but for what each point states."""


FARTHEST = 1e8
"""Greatest absolute value of a time, s, of scans from any source; and of any number in a file.

After longer gaps the covariance of a prediction is no longer positive definite in float64.
"""


@dataclass(frozen=True)
class FieldOfView:
    """Borders of a sensor's view: a target there may be cut off.

    Attributes:
        right, left: bearings of the borders, rad from the sensor's heading.
        baseline: distance to a second camera on the right, m, which must see a point, too; 0: no
            second camera.
    """

    right: float
    left: float
    baseline: float = 0.0


@dataclass(frozen=True)
class Scans:
    """Candidate points of K scans, gated by the scene and not by a tracker.

    An empty scan is an ordinary scan.

    Attributes:
        times: (K,) s.
        sensor_poses_world: (K, 3) x m, y m, heading rad of the sensor.
        offsets: (K + 1,) int64, the points of scan k are rows offsets[k]:offsets[k + 1].
        points_world: (P, 2) m.
        covariances_world: (P, 2, 2) m².
        field_of_view: of the sensor; None: unknown.
        epoch: ns since 1970 at the time 0; None: unknown.
        shared_errors: what all of the points share, beyond their covariances.
        heights: (P,) m above the road; then several points may be of one bearing. None: unknown.
    """

    times: np.ndarray
    sensor_poses_world: np.ndarray
    offsets: np.ndarray
    points_world: np.ndarray
    covariances_world: np.ndarray
    field_of_view: FieldOfView | None = None
    epoch: int | None = None
    shared_errors: SharedErrors = NO_SHARED_ERRORS
    heights: np.ndarray | None = None

    def __post_init__(self):
        for k in np.flatnonzero(~(np.abs(self.times) <= FARTHEST)):
            raise ValueError(
                f"time of scan {k}: {self.times[k]:g} s: must be within ±{FARTHEST:g} s"
            )

    @classmethod
    def of_each(
        cls,
        times: np.ndarray,
        sensor_poses_world: np.ndarray,
        scans: Sequence[tuple[np.ndarray, np.ndarray]],
        field_of_view: FieldOfView | None = None,
        shared_errors: SharedErrors = NO_SHARED_ERRORS,
        heights: Sequence[np.ndarray] | None = None,
    ) -> "Scans":
        """From `times` (K,) s, poses (K, 3), and points (n_k, 2) m and covariances (n_k, 2, 2) m².

        The last two are given for each scan, in order, as are `heights` (n_k,) m; all are in the
        world.

        Example:
            >>> points, covariances = np.array([[1.0, 9.0], [1.5, 9.0]]), 0.01 * np.eye(2)
            >>> first = points, covariances[None].repeat(2, axis=0)
            >>> empty = np.zeros((0, 2)), np.zeros((0, 2, 2))
            >>> scans = Scans.of_each([0.0, 0.1], [[0.0, 0.0, np.pi / 2]] * 2, [first, empty])
            >>> len(scans), scans.points_world[scans.rows(0)].shape, scans.rows(1)
            (2, (2, 2), slice(2, 2, None))
        """
        return cls(
            times=np.array(times, dtype=np.float64),
            sensor_poses_world=np.array(sensor_poses_world, dtype=np.float64),
            offsets=np.cumsum([0, *(len(scan[0]) for scan in scans)], dtype=np.int64),
            points_world=np.concatenate([np.zeros((0, 2)), *(scan[0] for scan in scans)]),
            covariances_world=np.concatenate([np.zeros((0, 2, 2)), *(scan[1] for scan in scans)]),
            field_of_view=field_of_view,
            shared_errors=shared_errors,
            heights=None if heights is None else np.concatenate([np.zeros(0), *heights]),
        )

    def __len__(self) -> int:
        return len(self.times)

    def rows(self, k: int) -> slice:
        """The rows of scan k."""
        return slice(int(self.offsets[k]), int(self.offsets[k + 1]))

    def of_rows(self, rows: np.ndarray) -> "Scans":
        """The scans with the points at `rows` (n,), ascending, only."""
        return replace(
            self,
            offsets=np.searchsorted(rows, self.offsets),
            points_world=self.points_world[rows],
            covariances_world=self.covariances_world[rows],
            heights=None if self.heights is None else self.heights[rows],
        )

    def nearest_returns(self) -> tuple["Scans", np.ndarray]:
        """The scans with the nearest point of each object in each bearing, and its rows (n,) here.

        Seen from above, bonnet, windscreen and roof are inside of the outline, which the nearest
        point of their bearing shows. Over a hedge, what is behind it is seen, too. Without heights,
        nothing changes.
        """
        kept = np.ones(len(self.points_world), bool)
        for k in [] if self.heights is None else np.flatnonzero(np.diff(self.offsets)):
            rows, sensor = self.rows(k), self.sensor_poses_world[k]
            offsets = self.points_world[rows] - sensor[:2]
            bearings = wrap_angle(np.arctan2(offsets[:, 1], offsets[:, 0]) - sensor[2])
            columns, ranges = np.round((bearings - bearings.min()) / BEARING), np.hypot(*offsets.T)
            order = np.lexsort((ranges, columns))
            other_bearing, farther = np.diff(columns[order]) > 0.0, np.diff(ranges[order]) > BEHIND
            kept[rows.start + order[1:]] = other_bearing | farther
        found = np.flatnonzero(kept)
        return (self if kept.all() else self.of_rows(found)), found

    def pose_shifts(self, k: int, pose: np.ndarray) -> np.ndarray:
        """How the m shared errors move a target at `pose` (3,) in scan k: (3, m) m and rad.

        The sensor moves as since the scan before; at the first scan it stands still.
        """
        before, poses = max(k - 1, 0), self.sensor_poses_world
        rates = pose_rates(poses[before], poses[k], self.times[k] - self.times[before])
        return self.shared_errors.pose_shifts(pose, poses[k], rates)


def points_along(
    sensor_pose_world: np.ndarray,
    angles: np.ndarray,
    ranges: np.ndarray,
    along_variances: np.ndarray,
    across_variances: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) m and covariances (n, 2, 2) m² in the world of measurements along rays.

    The rays leave the sensor at `sensor_pose_world` (3,) at `angles` (n,) rad from its heading. The
    variances (n,) m² are those along and across the ray: R = s_across² I + (s_along² - s_across²)
    d dᵀ with the unit vector d.
    """
    bearings = sensor_pose_world[2] + angles
    along = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    squares = along[:, :, None] * along[:, None, :]
    covariances = (along_variances - across_variances)[:, None, None] * squares
    covariances[:, 0, 0] += across_variances
    covariances[:, 1, 1] += across_variances
    return sensor_pose_world[:2] + ranges[:, None] * along, covariances
