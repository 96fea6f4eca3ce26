"""The truth of `path=recorded`: a road user of the scene that moves as a labelled one did."""

from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_smoothing_spline

from stixel_cli.recordings.labelled import label_pose
from stixel_cli.recordings.tables import read_kitti_labels, track_of
from stixel_cli.scene.contours import moving_target
from stixel_cli.scene.road_user_parameters import RoadUser
from stixel_cli.scene.scenario import EgoMotion, Scenario


def replayed_scenario(
    ego_motion: EgoMotion,
    files: tuple[Path, ...],
    road_user: RoadUser,
    first: int,
    left_camera: tuple[float, float, float],
    target: int,
    smoothing: float,
) -> Scenario:
    """Ground truth of `road_user` on the smoothed path of one labelled target.

    The labels' places and headings are moved into the world by the ego poses. A smoothing spline
    over time of each coordinate gives the poses and their exact derivatives at all frames, those
    without a label among them.

    Args:
        ego_motion: at K successive frames; the first and the last have a label.
        files: the file of the labels, first.
        road_user: the target in the scene, with its own size.
        first: number of the first frame.
        left_camera: place of the left camera in the frame of the labels, m.
        target: its track id.
        smoothing: see `smoothing_spline`, s.

    Raises:
        UserError: if the file is not valid, or has no such target.
    """
    times = ego_motion.times
    labels = track_of(read_kitti_labels(files[0]), target, files[0], "path.target")
    rows = np.flatnonzero((labels.frames >= first) & (labels.frames < first + len(times)))
    frames = labels.frames[rows] - first
    places = labels.places[rows] - np.array(left_camera)
    poses = np.array(
        [
            label_pose(place, yaw, ego_motion.poses_world[k])
            for place, yaw, k in zip(places, labels.yaws[rows], frames, strict=True)
        ]
    )
    poses[:, 2] = np.unwrap(poses[:, 2])
    splines = [smoothing_spline(times[frames], values, smoothing) for values in poses.T]
    smooth = np.stack([spline(times) for spline in splines], axis=1)
    rates = np.stack([spline.derivative()(times) for spline in splines], axis=1)
    return moving_target(ego_motion, road_user, smooth, rates, travelled(times, rates))


def smoothing_spline(times: np.ndarray, values: np.ndarray, period: float) -> BSpline:
    """The natural cubic smoothing spline of `values` (n,), n ≥ 5, at `times` (n,) s.

    It minimises Σ (value - f)² + λ ∫ f''². At evenly spaced times with step T that is a filter of
    gain 1 / (1 + λ T ω⁴) (Silverman 1984, *Spline smoothing: the equivalent variable kernel
    method*). λ makes the gain 1/2 at the given period, s. With 0 it goes through all values.
    """
    step = np.median(np.diff(times))
    return make_smoothing_spline(times, values, lam=(period / (2.0 * np.pi)) ** 4 / step)


def travelled(times: np.ndarray, rates_world: np.ndarray) -> np.ndarray:
    """Length driven (K,) m at `times` (K,) s, by the trapezoidal rule."""
    speeds = np.hypot(rates_world[:, 0], rates_world[:, 1])
    steps = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)
    return np.concatenate([[0.0], np.cumsum(steps)])
