"""Small cases that the trackers' tests share."""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.pose import world_from_target
from stixel_cli.measurements.scans import FieldOfView, Scans
from stixel_cli.tracking.gp_ekf import GpEkfParameters
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.track import InitialState

GOLDEN = Path(__file__).parent / "golden"

STDS = {"sigma_f": 1.0, "sigma_r": 0.4, "measurement_std": 0.1}
SHAPE = {"length": 4.2, "width": 1.7, "shape": "rectangle", "corner_radius": 0.3, "outline": None}
CLASS = {"road_user": "car", "length_std": 0.06, "width_std": 0.06, "start_position": 0.3}
CAR = PriorShape(**SHAPE, **STDS, **CLASS)

CONTOUR = {"basis_points": 24, "length_scale": np.pi / 8}
MOTION = {"sigma_q": 1.0, "sigma_q_psi": 0.2, "slip": None, "forgetting_rate": 1e-4, "lag": 0}
POINTS = {"seen_by": None, "gate_probability": 0.99}
TRACKER = GpEkfParameters(kind="gp_ekf", **CONTOUR, **MOTION, **POINTS, **STDS)

FIELD = FieldOfView(-0.52, 0.52)

VARIANCES = [0.1, 0.1, 0.01, 0.25, 0.25, 0.01]
START = InitialState(np.array([7.5, 12.0, 0.1, 5.0, 0.5, 0.2]), np.diag(VARIANCES))


def scans_of(points, covariances=None, times=None):
    """`Scans` of a list of arrays (n_k, 2)."""
    times = 0.1 * np.arange(len(points)) if times is None else times
    poses = np.tile([0.0, 0.0, np.pi / 2], (len(points), 1))
    if covariances is None:
        covariances = [np.tile(0.01 * np.eye(2), (len(one), 1, 1)) for one in points]
    return Scans.of_each(times, poses, [*zip(points, covariances, strict=True)], FIELD)


def jacobian(function, at, step=1e-6):
    """Central differences (…, n) of the function by each element of `at` (n,)."""
    units = step * np.eye(len(at))
    return np.stack([function(at + u) - function(at - u) for u in units], axis=-1) / (2.0 * step)


def poses_of_turn(count, start=START):
    """True poses (count, 3) of a target that starts one sample after `start`."""
    pose, rates = start.mean[:3], start.mean[3:]
    return pose + 0.1 * np.arange(1, count + 1)[:, None] * rates


def rectangle_points(random, count, length=4.5, width=1.8):
    """Points (count, 2) in the target's frame, even over a rectangle's outline."""
    s = random.uniform(0.0, 2.0 * (length + width), count)
    a, b = 0.5 * length, 0.5 * width
    corners = np.cumsum([0.0, length, width, length, width])
    x = np.interp(s, corners, [-a, a, a, -a, -a])
    y = np.interp(s, corners, [-b, -b, b, b, -b])
    return np.stack([x, y], axis=-1)


def seen_car(count, points, seed=0, noise=0.1):
    """Scans (list of (points, 2)) of a whole car's outline that moves as `poses_of_turn` says."""
    random = np.random.default_rng(seed)
    scans = []
    for x, y, heading in poses_of_turn(count):
        outline = world_from_target(rectangle_points(random, points), (x, y, heading))
        scans.append(outline + noise * random.standard_normal((points, 2)))
    return scans
