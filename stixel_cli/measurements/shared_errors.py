"""Errors that all points of a recording share: of the rig, the clock, the ego poses."""

from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotation


@dataclass(frozen=True)
class SharedErrors:
    """Standard deviations of errors that stay the same over all scans; 0 or empty: there is none.

    A point's own covariance does not contain them. A tracker cannot average them out: it considers
    them, see `tracking/consider.py`.

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


NO_SHARED_ERRORS = SharedErrors()
"""Of a sensor that is exact but for what each point states."""
