"""The results of a run as tables and as named arrays, those of its files, written and read."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from stixel_cli.border.files import read_arrays
from stixel_cli.errors import UserError, located
from stixel_cli.evaluation.scores import Scores
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotations, world_from_ego, wrap_angle
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import read_truth
from stixel_cli.measurements.scans import Scans
from stixel_cli.results.result import RunResult, read_png, read_scored_run
from stixel_cli.scene.scenario import Scenario
from stixel_cli.stixels.types import Objects, Stixels
from stixel_cli.tracking.track import STATE, ObjectTrack, Track, state_columns


def pose_columns(times: np.ndarray, poses_world: np.ndarray) -> dict[str, np.ndarray]:
    """Poses (K, 3) in the world at `times` (K,) s as a table: k, t (s), x, y (m), heading (rad)."""
    x, y, heading = poses_world.T
    return {"k": np.arange(len(times)), "t": times, "x": x, "y": y, "heading": heading}


def scans_in_ego_frame(scans: Scans, ego_poses_world: np.ndarray) -> dict[str, np.ndarray]:
    """The table of the scans in the frame of the ego car, whose pose at each k is in (K, 3)."""
    poses = np.repeat(ego_poses_world, np.diff(scans.offsets), axis=0)
    turn, away = rotations(STRAIGHT_AHEAD - poses[:, 2]), scans.points_world - poses[:, :2]
    points = (turn @ away[:, :, None])[:, :, 0]
    covariances = turn @ scans.covariances_world @ turn.swapaxes(1, 2)
    return scan_columns(replace(scans, points_world=points, covariances_world=covariances))


def track_in_ego_frame(track: Track, ego_poses_world: np.ndarray) -> dict[str, np.ndarray]:
    """The state over time in the frame of the ego car, whose poses are (K, 3), one row per scan.

    The rates are those over the ground, along the axes of the ego car: its own motion is not
    subtracted. The heading is in (-pi, pi], counter-clockwise from the ego car's x axis, so a
    target that drives as the ego car does has pi/2.

    Returns:
        k, t (s), x, y (m), heading (rad), x_rate, y_rate (m/s), heading_rate (rad/s), and for each
        of the six std_….
    """
    turn, means = rotations(STRAIGHT_AHEAD - ego_poses_world[:, 2]), track.means.copy()
    means[:, :3] -= ego_poses_world - [0.0, 0.0, STRAIGHT_AHEAD]
    means[:, 2] = wrap_angle(means[:, 2])
    covariances = track.covariances.copy()
    for xy in (slice(0, 2), slice(3, 5)):
        means[:, xy] = (turn @ means[:, xy, None])[:, :, 0]
        covariances[:, xy, xy] = turn @ covariances[:, xy, xy] @ turn.swapaxes(1, 2)
    k = np.arange(len(track.times))
    return {"k": k, "t": track.times, **state_columns(means, covariances)}


def scan_columns(scans: Scans) -> dict[str, np.ndarray]:
    """The scans as a table, one row per point: k, t (s), x, y (m), variances (m²), z if known."""
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return {
        "k": k,
        "t": scans.times[k],
        "x": scans.points_world[:, 0],
        "y": scans.points_world[:, 1],
        "var_xx": scans.covariances_world[:, 0, 0],
        "var_xy": scans.covariances_world[:, 0, 1],
        "var_yy": scans.covariances_world[:, 1, 1],
        **({} if scans.heights is None else {"z": scans.heights}),
    }


def track_columns(track: Track) -> dict[str, np.ndarray]:
    """The track as a table, one row per scan: pose, rates, their stds, number of points used."""
    return {
        "k": np.arange(len(track.times)),
        "t": track.times,
        **state_columns(track.means, track.covariances),
        "points_used": np.diff(track.used_offsets),
        "nis": track.nis,
        "nis_degrees_of_freedom": track.nis_degrees_of_freedom,
        **class_columns(track),
    }


def tracks_columns(tracks: Sequence[ObjectTrack]) -> dict[str, np.ndarray]:
    """The tracks as one table: `track`, its number from 0, and the columns of `track_columns`.

    k is that of the run; `confirmed` is 0 before the scan that confirmed the track, then 1.
    """
    import pandas

    tables = [pandas.DataFrame(track_columns(one.track)) for one in tracks]
    for number, (one, table) in enumerate(zip(tracks, tables, strict=True)):
        table["k"] += one.first
        table["confirmed"] = (table["k"] >= one.confirmed).astype(int)
        table.insert(0, "track", number)
    # A track of the prior's class has no probabilities: NaN.
    return {name: column.to_numpy() for name, column in pandas.concat(tables).items()}


def score_columns(scores: Scores) -> dict[str, np.ndarray]:
    """The errors as a table, one row per scan; units as in `Scores`.

    Without any truth only the NIS.
    """
    with_truth = ("centre_error", "orientation_error", "iou", "iou_box", "nees_position")
    names = (*(with_truth if np.isfinite(scores.iou_box).any() else ()), "nis")
    columns = {name: getattr(scores, name) for name in names}
    return {"k": np.arange(len(scores.times)), "t": scores.times, **columns}


def truth_columns(scenario: Scenario) -> dict[str, np.ndarray]:
    """The truth as a table, one row per scan with a known pose: the pose, its rates, and the size.

    length and width, m, are those of the box along and across the heading.
    """
    k = np.flatnonzero(scenario.known)
    poses = pose_columns(scenario.times[k], scenario.target_poses_world[k])
    rates = dict(zip(STATE[3:], scenario.target_rates_world[k].T, strict=True))
    length, width = np.ptp(scenario.box_target, axis=0)
    sizes = {"length": np.full(len(k), length), "width": np.full(len(k), width)}
    return {**poses, "k": k, **rates, **sizes}


def truth_arrays(scenario: Scenario) -> dict[str, np.ndarray]:
    """The columns of the truth, and the target's `contour` (L, M, 2) m in its own frame.

    L is the number of poses of the limbs; the column limb_pose has that of each row. Where only the
    box is known there is no contour.
    """
    columns = truth_columns(scenario)
    if scenario.only_box:
        return columns
    limb_poses = scenario.limb_poses[columns["k"]]
    return columns | {"limb_pose": limb_poses, "contour": scenario.contours_target}


def track_arrays(track: Track) -> dict[str, np.ndarray]:
    """All arrays of the track by name; shapes as in `Track`. A class has an array of its own."""
    arrays = {name: value for name, value in vars(track).items() if isinstance(value, np.ndarray)}
    return arrays | class_columns(track)


def class_columns(track: Track) -> dict[str, np.ndarray]:
    """The probability of each class, (K,); empty for a track without them."""
    return {f"{name}_probability": p for name, p in (track.class_probabilities or {}).items()}


def stixel_columns(chunks: Sequence[Stixels]) -> dict[str, np.ndarray]:
    """One row per stixel of chunks in order.

    k; columns `left` to `right` - 1 and rows `top` to `base`, px; `disparity`, px, compensated for
    the pitch; `depth` and `height`, m; the ground point `x` (right), `y` (ahead of the camera), m,
    and its covariance `var_xx`, `var_xy`, `var_yy`, m².
    """
    names = ("left", "right", "top", "base", "disparity", "depth", "height")
    own = {name: np.concatenate([getattr(one, name) for one in chunks]) for name in names}
    x, y = np.concatenate([one.points_ego for one in chunks]).T
    covariances = np.concatenate([one.covariances_ego.reshape(-1, 4) for one in chunks])
    var_xx, var_xy, _, var_yy = covariances.T
    counts = np.concatenate([np.diff(one.offsets) for one in chunks])
    k = np.repeat(np.arange(len(counts)) + chunks[0].first, counts)
    return {"k": k, **own, "x": x, "y": y, "var_xx": var_xx, "var_xy": var_xy, "var_yy": var_yy}


def object_columns(
    objects: Sequence[Objects], times: np.ndarray, ego_poses_world: np.ndarray
) -> dict[str, np.ndarray]:
    """One row per object of chunks in order: its stixels, its box in the image and on the ground.

    k, t (s), object (number in the frame, from 0), stixels, left, right, top, base (px, columns
    left … right - 1, rows top … base), and in the world frame x, y (m, the centre), length and
    width (m), heading (rad, along the length; either end may be the front). `times` (K,) are in s,
    the poses (K, 3).
    """
    counts = np.concatenate([np.diff(one.offsets) for one in objects])
    k = np.repeat(np.arange(len(counts)), counts)
    left, right, top, base = np.concatenate([one.boxes for one in objects]).T
    corners_ego = np.concatenate([one.corners_ego for one in objects])
    corners = map(world_from_ego, corners_ego, ego_poses_world[k])
    corners_world = np.array(list(corners)).reshape(-1, 4, 2)
    sides = corners_world[:, 1:3] - corners_world[:, :2]
    sizes = np.hypot(*np.moveaxis(sides, 2, 0))
    longer = sizes.argmax(axis=1)
    along = sides[np.arange(len(k)), longer]
    x, y = corners_world.mean(axis=1).T
    return {
        "k": k,
        "t": times[k],
        "object": np.concatenate([np.arange(n) for n in counts]),
        "stixels": np.concatenate([one.counts for one in objects]),
        "left": left,
        "right": right,
        "top": top,
        "base": base,
        "x": x,
        "y": y,
        "length": sizes.max(axis=1),
        "width": sizes.min(axis=1),
        "heading": np.arctan2(along[:, 1], along[:, 0]),
    }


def with_arrays(run: RunResult) -> RunResult:
    """A run that was read, with what `read_scored_run` adds, the picture of the path, `scenario`,
    `scans` and `track`.

    The poses of the sensor are those of the ego car. Folders do not store `Scenario.scored`.
    UserError if a file is missing or not valid; folders of older versions have no `ego.npz`.
    """
    folder, picture = run.folder, run.folder / "figures/path.png"
    points, truth, smoothed = (folder / f"{name}.npz" for name in ("scans", "truth", "smoothed"))
    road_z = 0.0 if "z" in read_arrays(points) else None
    scans = read_scans(str(points), str(folder / "ego.npz"), 0.0, road_z=road_z)
    track = _read_track(folder / "track.npz")
    return replace(
        run,
        scores=read_scored_run(folder).scores,
        pictures={picture.name: read_png(picture)} if picture.exists() else {},
        scenario=read_truth(scans, str(truth) if truth.exists() else None),
        scans=scans,
        track=replace(track, smoothed=_read_track(smoothed) if smoothed.exists() else None),
    )


def _read_track(file: Path) -> Track:
    """The track in a file; UserError, which names it, if its arrays are not of a run."""
    arrays, ending = read_arrays(file), "_probability"
    classes = {n.removesuffix(ending): p for n, p in arrays.items() if n.endswith(ending)}
    own = {f.name: arrays[f.name] for f in fields(Track) if f.name in arrays}
    with located(f"{file}: not of a run", UserError, (IndexError, TypeError, ValueError)):
        return Track(**own, class_probabilities=classes or None)
