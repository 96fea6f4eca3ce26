"""Scans whose sensor's poses are wrong, as `measurement` of `stixel study consistency`."""

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import ego_from_world, rotate_covariances, world_from_ego
from stixel_cli.measurements.fabricated import fabricate_scans
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.scenario import Scenario


def wrong_poses(
    scenario: Scenario,
    seed: int,
    yaw_deg: float = 0.0,
    late_s: float = 0.0,
    range_m: float = 0.0,
    drift_m_s: float = 0.0,
) -> Scans:
    """Fabricated scans with constant noise, put into the world by wrong poses of the sensor.

    They state what `measurement=file` does of the errors that scans share.

    Args:
        yaw_deg: error of all headings, degrees.
        late_s: each pose is the true one of so much earlier, s; before the first scan the first.
        range_m: error of all ranges, m.
        drift_m_s: the place drifts along the world's x, m/s.
    """
    fabricated = compose(("measurement=fabricated", "measurement/noise=constant")).configuration
    stated = compose(("measurement=file", "measurement.path=scans.csv")).configuration.measurement
    true = fabricate_scans(scenario, fabricated.rig, fabricated.measurement, seed)
    elapsed = true.times - true.times[0]
    poses = np.stack(
        [np.interp(elapsed - late_s, elapsed, column) for column in true.sensor_poses_world.T],
        axis=-1,
    )
    poses[:, 0] += drift_m_s * elapsed
    poses[:, 2] += np.radians(yaw_deg)
    scans = []
    for k, (pose, wrong) in enumerate(zip(true.sensor_poses_world, poses, strict=True)):
        points = ego_from_world(true.points_world[true.rows(k)], pose)
        points *= 1.0 + range_m / np.hypot(*points.T)[:, None]
        covariances = rotate_covariances(true.covariances_world[true.rows(k)], wrong[2] - pose[2])
        scans.append((world_from_ego(points, wrong), covariances))
    return Scans.of_each(true.times, poses, scans, true.field_of_view, stated.shared_errors)
