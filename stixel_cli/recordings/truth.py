"""The truth in the labels of a recording, moved into the world by the ego poses.

A label's contour is its rectangle. A frame counts for the scores if its label is neither truncated
nor occluded.
"""

from pathlib import Path

import numpy as np

from stixel_cli.geometry.pose import label_pose, rectangle
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.tables import labels_of, read_labels
from stixel_cli.recordings.types import Labels, LabelTruth, Tables
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE
from stixel_cli.scene.scenario import EgoMotion, Scenario

HALF_WINDOW = 2
"""Rates are slopes over this many frames before and after, where they are labelled."""

LEAST_FRAMES = 3
"""Labelled frames that a rate needs: labels are keyframes joined by straight lines."""


def recorded_scenario(
    ego_motion: EgoMotion,
    files: tuple[Path, ...],
    rig: Rig,
    tables: Tables,
    target: int | str | None,
) -> Scenario:
    """Ground truth of one labelled target; NaN at the frames without its label.

    Args:
        ego_motion: at the frames of the recording.
        files: the files of the labels; empty without target.
        rig: the ground plane is that of its level frame.
        tables: how the files are written.
        target: its track id; None for no truth.

    Raises:
        UserError: if the file is not valid, or has no such target.
    """
    labels = None if target is None else labels_of(files, tables, target)
    return _scenario(ego_motion, labels, rig, tables)


def label_truths(
    ego_motion: EgoMotion, files: tuple[Path, ...], rig: Rig, tables: Tables
) -> tuple[LabelTruth, ...]:
    """The truth of each label in the frames of `ego_motion`; () without files.

    The arguments and errors are those of `recorded_scenario`.
    """
    first, stop = tables.first, tables.first + len(ego_motion.times)
    return tuple(
        LabelTruth(
            str(name),
            CLASS_OF_KITTI_TYPE.get(labels.kind, "other"),
            _scenario(ego_motion, labels, rig, tables),
        )
        for name, labels in (read_labels(files, tables).items() if files else ())
        if np.any((labels.frames >= first) & (labels.frames < stop))
    )


def _scenario(ego_motion: EgoMotion, labels: Labels | None, rig: Rig, tables: Tables) -> Scenario:
    count = len(ego_motion.times)
    poses, contour = np.full((count, 3), np.nan), np.zeros((0, 2))
    scored = np.zeros(count, dtype=bool)
    if labels is not None:
        inside = (labels.frames >= tables.first) & (labels.frames < tables.first + count)
        for k, row in zip(
            labels.frames[inside] - tables.first, np.flatnonzero(inside), strict=True
        ):
            place = rig.level_from_camera @ (labels.places[row] - tables.left_camera)
            poses[k] = label_pose(place, labels.yaws[row], ego_motion.poses_world[k])
            scored[k] = labels.truncated[row] == 0 and labels.occluded[row] == 0
        known = np.isfinite(poses[:, 2])
        poses[known, 2] = np.unwrap(poses[known, 2])
        _, width, length = np.median(labels.sizes[inside], axis=0)
        contour = rectangle(length, width)
    return Scenario(
        times=ego_motion.times,
        ego_poses_world=ego_motion.poses_world,
        target_poses_world=poses,
        target_rates_world=slopes(ego_motion.times, poses),
        contours_target=contour[None],
        only_box=True,
        scored=scored,
    )


def slopes(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slope (K, n) of each column of `values` (K, n) at `times` (K,), by least squares.

    Over the rows without NaN among the `HALF_WINDOW` before and after; at an end of the labels,
    over the nearest `LEAST_FRAMES`. Fewer rows give NaN, and so does a row of NaN.
    """
    rates = np.full(values.shape, np.nan)
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    for k in known if len(known) >= LEAST_FRAMES else ():
        away = np.abs(known - k)
        near = known[(away <= HALF_WINDOW) | (away <= np.sort(away)[LEAST_FRAMES - 1])]
        rates[k] = np.polyfit(times[near] - times[k], values[near], 1)[0]
    return rates
