"""Scans from a lidar's returns; `lidar_casting` describes its place and its angles."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from stixel_cli.measurements.parameters import Gated, LidarReturns, Scanner
from stixel_cli.measurements.scans import FieldOfView, Scans, points_along
from stixel_cli.parameters import parameters
from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import EgoMotion


@parameters(kw_only=True)
class LidarParameters(Gated):
    """Scans from a lidar.

    Attributes:
        scanner: layers, beams and mounting.
        range_std: standard deviation of the range along the beam, m.
        missed_probability: probability that a beam which hits gives no return.
        returns: `all` returns that pass the gates, with their heights, or per azimuth the
            `nearest`, without: as of a scanner that was projected to one plane.
    """

    kind: Literal["lidar"]
    scanner: Scanner
    range_std: Annotated[float, Ge(0), Le(10)]
    missed_probability: Annotated[float, Ge(0), Le(1)]
    returns: Literal["nearest", "all"]

    def check(self) -> None:
        """Raise ValueError unless the gate of height is open and the layers go upwards."""
        lowest, highest = self.scanner.elevation_lowest, self.scanner.elevation_highest
        single = self.scanner.layers == 1
        if highest < lowest or (highest == lowest and not single):
            raise ValueError(
                f"measurement.scanner.elevation_highest: must be {'≥' if single else '>'} "
                f"measurement.scanner.elevation_lowest ({lowest} degrees) with "
                f"measurement.scanner.layers={self.scanner.layers}, got {highest}"
            )
        super().check()


def lidar_scans(
    returns: LidarReturns,
    ego_motion: EgoMotion,
    measurement: LidarParameters,
    field_of_view: tuple[float, float],
    seed: int,
) -> Scans:
    """Scans of the returns inside the gates, with noise along the beam, on the world's ground.

    The gates use the measured point's height above the road, which leaves out the ground, and its
    distance. Then the point is projected to the ground plane. Several layers meet bumper, bonnet,
    windscreen and roof, and seen from above all but the first are inside the outline: of `all`
    points, which have heights, trackers take the nearest, see `Scans.nearest_returns`. With
    `returns: nearest` only that of each azimuth is kept. The nearest of several noisy ranges is too
    near by about their standard deviation: 0.6 of it for two that measure the same face, 1.5 for
    ten.

    The covariance of a point is the noise along the beam, projected to the ground, and (r dtheta)²
    / 12 across. `field_of_view` has the bearings of the lidar's right and left border, rad.
    """
    scans = [
        _scan(returns, k, pose, measurement, generator(seed, "lidar", k))
        for k, (_, pose) in enumerate(zip(returns.ranges, ego_motion.poses_world, strict=True))
    ]
    view = FieldOfView(*field_of_view)
    heights = [scan[2] for scan in scans] if measurement.returns == "all" else None
    return Scans.of_each(ego_motion.times, ego_motion.poses_world, scans, view, heights=heights)


def _scan(
    returns: LidarReturns,
    k: int,
    sensor_pose_world: np.ndarray,
    measurement: LidarParameters,
    random: "np.random.Generator",
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 2) m, covariances (n, 2, 2) m² in the world and heights (n,) m of scan `k`."""
    # Noise is drawn for every beam, hit or not, so that an option does not change the remaining
    # points.
    noise = random.standard_normal(returns.ranges.shape[1:])
    measured = returns.ranges[k].astype(np.float64) + measurement.range_std * noise
    answered = np.isfinite(measured)
    if measurement.missed_probability > 0.0:
        answered &= random.random(measured.shape) >= measurement.missed_probability
    measured[~answered] = 0.0

    elevations = returns.elevations[:, None]
    heights = measurement.scanner.mount_height + measured * np.sin(elevations)
    ground = measured * np.cos(elevations)
    inside = answered & (heights >= measurement.height_min) & (heights <= measurement.height_max)
    inside &= (ground >= measurement.range_min) & (ground <= measurement.range_max)
    if measurement.returns == "nearest":
        gated = np.where(inside, ground, np.inf)
        beam = np.flatnonzero(np.isfinite(gated.min(axis=0)))
        layer = gated.argmin(axis=0)[beam]
    else:
        beam, layer = np.nonzero(inside.T)

    distances = ground[layer, beam]
    along_variance = (measurement.range_std * np.cos(returns.elevations[layer])) ** 2
    step = np.radians(measurement.scanner.azimuth_step)
    variances = along_variance, (distances * step) ** 2 / 12.0
    points = points_along(sensor_pose_world, returns.azimuths[beam], distances, *variances)
    return *points, heights[layer, beam]
