"""The motion of the ego car."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.parameters import parameters
from stixel_cli.scene.scenario import EgoMotion


@parameters
class Parked:
    """The ego car does not move."""

    kind: Literal["parked"]


@parameters
class Straight:
    """The ego car drives straight ahead.

    Attributes:
        speed: m/s.
    """

    kind: Literal["straight"]
    speed: Annotated[float, Ge(0), Le(60)]


@parameters
class Turning:
    """The ego car drives along an arc.

    Attributes:
        speed: m/s.
        yaw_rate: degrees/s, positive to the left.
    """

    kind: Literal["turning"]
    speed: Annotated[float, Ge(0), Le(60)]
    yaw_rate: Annotated[float, Ge(-90), Le(90)]


@parameters
class RecordedEgo:
    """The ego car moves as in the recording; composed for it, so no option has this kind."""

    kind: Literal["source"]


Ego = Parked | Straight | Turning | RecordedEgo


def ego_motion(ego: Ego, duration: float, sample_time: float) -> EgoMotion:
    """Times and exact poses of the ego car, (0, 0, pi/2) at k = 0.

    There are K = round(`duration` / `sample_time`) scans, s, but one at least; scan k is at
    t = k `sample_time`.
    """
    count = max(1, round(duration / sample_time))
    times = sample_time * np.arange(count)
    return EgoMotion(times=times, poses_world=ego_poses(ego, times))


def ego_poses(ego: Ego, times: np.ndarray) -> np.ndarray:
    """Poses (K, 3) x m, y m, heading rad of the ego car at `times` (K,) s."""
    times = np.asarray(times, dtype=np.float64)
    speed = ego.speed if isinstance(ego, Straight | Turning) else 0.0
    yaw_rate = np.radians(ego.yaw_rate) if isinstance(ego, Turning) else 0.0
    # The chord of an arc is v t sinc(ω t / 2) long and points along the mean heading; written so,
    # a straight line is no special case.
    chord = speed * times * np.sinc(0.5 * yaw_rate * times / np.pi)
    direction = 0.5 * yaw_rate * times
    return np.stack(
        [-chord * np.sin(direction), chord * np.cos(direction), STRAIGHT_AHEAD + yaw_rate * times],
        axis=1,
    )
