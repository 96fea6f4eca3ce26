"""Trackers that take one scan after the other: `Contour`.

The parameters are those of `stixel run tracker=contour`, from the same files. Neither Hydra nor the
engine is imported.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from stixel_cli.errors import ArgumentError
from stixel_cli.geometry.pose import pose_rates
from stixel_cli.measurements.scans import NO_SHARED_ERRORS, SharedErrors
from stixel_cli.tracking.motion import LONGEST_GAP
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState

if TYPE_CHECKING:
    from stixel_cli.measurements.scans import FieldOfView
    from stixel_cli.tracking.contour.contour_parameters import ContourParameters

POSE_STD = (0.3, 0.3, 0.2)
"""Standard deviations of a pose from which a tracker starts: m, m, rad."""

TURN_RATE_STD = 0.4
"""Of a target of which only the pose is known, rad/s. Its speed is any of its class."""


@dataclass(frozen=True)
class Estimate:
    """What a tracker knows after a scan, in the world.

    Attributes:
        pose: (3,) x m, y m, heading rad, and covariance: its, (3, 3).
        velocity: (2,) m/s.
        box: (2,) m, length and width.
        contour: (M, 2) m, the outline, counter-clockwise.
        points: (m,) indices of the points that were used.
        nis: normalised innovation squared over its degrees of freedom; NaN without a point.
    """

    pose: np.ndarray
    covariance: np.ndarray
    velocity: np.ndarray
    box: np.ndarray
    contour: np.ndarray
    points: np.ndarray
    nis: float


class Contour:
    """The tracker `contour`, which takes one scan after the other and knows no later one.

    Args:
        road_user: `car`, `cyclist`, `pedestrian`, or `unknown`: the scans show it.
        start: (3,) the target's pose in the world at the first scan, x m, y m, heading rad; or an
            `InitialState`.
        start_time: of the start, s; None for that of the first scan.
        sensor: what measures the points, as `tracker.seen_by`.
        field_of_view: of the sensor; an end of the target at its border is not used as one.
        shared_errors: those that all points share, of rig, clock and poses.
        settings: parameters of the tracker in the place of those in `conf/tracker/contour.yaml`.

    Raises:
        ArgumentError: in one line that names the argument.

    Example:
        >>> tracker = Contour("car", start=[0.0, 10.0, 0.0])
        >>> points = np.stack([np.linspace(-2.0, 2.0, 9), np.full(9, 9.1)], axis=1)
        >>> noise = np.tile(0.01 * np.eye(2), (9, 1, 1))
        >>> estimate = tracker.step(points, noise, [0.0, 0.0, np.pi / 2], time=0.0)
        >>> bool(np.hypot(*estimate.pose[:2] - [0.0, 10.0]) < 0.3), estimate.contour.shape
        (True, (240, 2))
    """

    def __init__(
        self,
        road_user: str = "car",
        *,
        start: "np.ndarray | InitialState",
        start_time: float | None = None,
        sensor: Literal["stixels", "fabricated", "lidar", "file", "own"] = "file",
        field_of_view: "FieldOfView | None" = None,
        shared_errors: SharedErrors = NO_SHARED_ERRORS,
        **settings: Any,
    ):
        from stixel_cli.tracking.contour.contour import ClassBank

        prior, parameters = _parameters(road_user, {"seen_by": sensor} | settings)
        if not isinstance(start, InitialState):
            start = _at_pose(_array("start", start, (3,)), road_user)
        self._bank = ClassBank(start, prior, replace(parameters, lag=0))
        self._field_of_view, self._shared_errors = field_of_view, shared_errors
        self._time, self._sensor_pose = start_time, None

    def step(
        self, points: np.ndarray, covariances: np.ndarray, sensor_pose: np.ndarray, time: float
    ) -> Estimate:
        """The estimate after one more scan.

        Args:
            points: (n, 2) m in the world, of all objects; n may be 0.
            covariances: (n, 2, 2) m².
            sensor_pose: (3,) x m, y m, heading rad.
            time: s, not before that of the scan before.

        Raises:
            ArgumentError: in one line that names the argument.
        """
        from stixel_cli.tracking.contour.contour_rays import rays_of

        points = _array("points", points, (None, 2))
        covariances = _array("covariances", covariances, (len(points), 2, 2))
        sensor_pose = _array("sensor_pose", sensor_pose, (3,))
        interval = 0.0 if self._time is None else time - self._time
        if not 0.0 <= interval < np.inf:
            raise ArgumentError(f"time: must not be before {self._time:g} s, got {time:g}")
        before = sensor_pose if self._sensor_pose is None else self._sensor_pose
        rates = pose_rates(before, sensor_pose, interval)
        self._time, self._sensor_pose = time, sensor_pose
        interval = min(interval, LONGEST_GAP)
        rays = rays_of(points, covariances, sensor_pose, self._field_of_view)
        track = self._bank.step(interval, rays)
        moved = self._shared_errors.pose_shifts(track.means[0], sensor_pose, rates)
        return Estimate(
            track.means[0, :3],
            track.covariances[0, :3, :3] + moved @ moved.T,
            track.means[0, 3:5],
            track.boxes[0],
            track.contours_world[0],
            track.used_points,
            float(track.normalised_nis[0]),
        )


def _array(name: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """The argument as an array; `None` in its `shape` stands for any length."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"{name}: must be numbers, got {type(value).__name__}") from None
    fits = array.ndim == len(shape) and all(
        own in (None, got) for own, got in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        right = str(shape).replace("None", "n")
        raise ArgumentError(f"{name}: must be finite, of shape {right}, got {array.shape}")
    return array


def _at_pose(pose: np.ndarray, road_user: str) -> InitialState:
    """The state of a target at a `pose` (3,), whose motion is not known."""
    from stixel_cli.scene.parameters import CLASS_ROWS

    known = [CLASS_ROWS[road_user]] if road_user in CLASS_ROWS else CLASS_ROWS.values()
    speed = max(row.speed for row in known)
    stds = [*POSE_STD, speed, speed, TURN_RATE_STD]
    return InitialState(np.concatenate([pose, np.zeros(3)]), np.diag(np.square(stds)))


def _parameters(road_user: str, settings: dict[str, Any]) -> "tuple[PriorShape, ContourParameters]":
    """The prior of a class and the parameters of the tracker, from the files of `conf/`."""
    from pydantic import ValidationError

    from stixel_cli.config import folders
    from stixel_cli.config.annotations import first_fault, read_as
    from stixel_cli.scene.parameters import ROAD_USER_CLASSES
    from stixel_cli.tracking.contour.contour_parameters import ContourParameters

    classes = (*ROAD_USER_CLASSES, "unknown")
    if road_user not in classes:
        raise ArgumentError(f"road_user: must be one of {', '.join(classes)}, got {road_user!r}")
    prior = folders.option_values("prior", road_user)
    of_prior = {f"${{prior.{name}}}": value for name, value in prior.items()}
    values = folders.option_values("tracker", "contour") | settings
    values = {name: of_prior.get(str(value), value) for name, value in values.items()}
    try:
        return PriorShape(**prior), read_as(ContourParameters, values)
    except ValidationError as error:
        raise ArgumentError(": ".join(first_fault(error)[:2])) from None
    except (TypeError, ValueError) as error:
        raise ArgumentError(str(error)) from None
