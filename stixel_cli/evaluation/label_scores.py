"""Scores of the tracks of moving objects against the labels of a recording.

At each scan the tracks are assigned to the labels: the most pairs, and of these the least sum of
centre distances (the association of CLEAR MOT: Bernardin, Stiefelhagen 2008). A pair is allowed up
to half the label's length, but at least `LEAST_REACH`.
"""

from collections.abc import Sequence

import numpy as np

from stixel_cli.evaluation import contour_errors
from stixel_cli.evaluation.scores import LabelScore, Scores, finite_mean
from stixel_cli.measurements.scans import Scans
from stixel_cli.recordings.types import LabelTruth
from stixel_cli.tracking.followed import LEAST_SCANS, least_speed, line
from stixel_cli.tracking.track import ObjectTrack, Track

NEVER = 1e3
"""m, more than any allowed distance."""

LEAST_REACH = 1.0
"""A track may be this far, m, from the label of a short road user."""

FALSE = 0.5
"""A track is false if it matches labels in less than this share of its scans."""


def score_tracks(
    tracks: tuple[ObjectTrack, ...], truths: tuple[LabelTruth, ...], scans: Scans, road_user: str
) -> Scores:
    """The scores of all tracks: their NIS, and those against the labels, if there are any.

    `truths` are all labels, of any class; those of the class `road_user` are scored.
    """
    points, missing = np.diff(scans.offsets), np.full(len(scans), np.nan)
    of_tracks = np.full((len(tracks), len(scans)), np.nan)
    for row, one in zip(of_tracks, tracks, strict=True):
        row[one.first : one.first + len(one.track.times)] = one.track.normalised_nis
    nis = np.ma.masked_invalid(of_tracks).mean(axis=0).filled(np.nan)
    metrics = {
        "nis_mean": finite_mean(nis),
        "scans": len(scans),
        "empty_scans": int(np.sum(points == 0)),
        "points_per_scan_mean": float(points.mean()),
        "tracks_found": len(tracks),
    }
    matches = _matches(tracks, truths) if truths else None
    own = [i for i, one in enumerate(truths) if one.road_user == road_user]
    labels = tuple(_score(truths[i], matches[i], tracks, scans) for i in own)
    if truths:
        shares = [np.sum(matches == j) / len(one.track.times) for j, one in enumerate(tracks)]
        metrics |= _sums(labels) | {"tracks_false": int(np.sum(np.array(shares) < FALSE))}
    # Neither errors of the centre and the orientation nor IoU and NEES.
    return Scores(scans.times, *5 * [missing], nis, metrics, labels)


def _sums(labels: Sequence[LabelScore]) -> dict[str, float | int | None]:
    """Sums over the expected labels, by the names of `metric_table.OF_LABELS`."""
    expected = [one for one in labels if one.expected]
    tracked = [one for one in expected if one.tracked_frames]
    frames = [one.tracked_frames for one in tracked]

    def over_frames(name: str) -> float:
        return np.average([getattr(one, name) for one in tracked], weights=frames).item()

    return {
        "labels_expected": len(expected),
        "labels_tracked": len(tracked),
        "labels_found_scans_mean": finite_mean(np.array([one.found_scans for one in tracked])),
        "labels_tracked_share": sum(frames) / sum(o.frames for o in expected) if expected else None,
        "labels_iou_box_mean": over_frames("iou_box") if tracked else None,
        "labels_centre_mean_m": over_frames("centre_m") if tracked else None,
        "label_switches": sum(one.switches for one in expected),
    }


def _matches(tracks: Sequence[ObjectTrack], truths: Sequence[LabelTruth]) -> np.ndarray:
    """The track of each label at each scan (N, K), its index, or -1."""
    from scipy.optimize import linear_sum_assignment

    count = len(truths[0].scenario.times)
    found = np.full((len(truths), count), -1)
    for k in range(count):
        here = [i for i, one in enumerate(truths) if one.scenario.known[k]]
        alive = [j for j, one in enumerate(tracks) if 0 <= k - one.first < len(one.track.times)]
        if not here or not alive:
            continue
        true = np.array([truths[i].scenario.target_poses_world[k, :2] for i in here])
        means = np.array([tracks[j].track.means[k - tracks[j].first, :2] for j in alive])
        apart = np.hypot(*np.moveaxis(true[:, None] - means, 2, 0))
        lengths = np.array([np.ptp(truths[i].scenario.box_target[:, 0]) for i in here])
        allowed = apart <= np.maximum(LEAST_REACH, 0.5 * lengths)[:, None]
        pairs = linear_sum_assignment(np.where(allowed, apart - NEVER, 0.0))
        for i, j in zip(*pairs, strict=True):
            if allowed[i, j]:
                found[here[i], k] = alive[j]
    return found


def _score(
    truth: LabelTruth, matched: np.ndarray, tracks: Sequence[ObjectTrack], scans: Scans
) -> LabelScore:
    """The score of a label whose tracks are `matched` (K,)."""
    scenario = truth.scenario
    counted = np.flatnonzero(scenario.known & scenario.scored)
    poses, camera = scenario.target_poses_world, scenario.ego_poses_world
    labelled = np.flatnonzero(scenario.known)
    _, velocity, _ = line(scenario.times[labelled], poses[labelled, :2])
    _, of_camera, _ = line(scenario.times[labelled], camera[labelled, :2])
    speed = float(np.hypot(*velocity))
    moves = speed >= least_speed(float(np.hypot(*of_camera)))
    at = counted[matched[counted] >= 0]
    rows = [(tracks[matched[k]], k - tracks[matched[k]].first) for k in at]
    means = np.array([track.track.means[row, :3] for track, row in rows]).reshape(-1, 3)
    iou, found_scans = np.zeros(0), np.nan
    if len(at):
        estimated = np.concatenate([_box(track.track, row) for track, row in rows])
        true, _ = contour_errors.boxes(scenario.boxes_world[at], poses[at])
        iou = contour_errors.overlaps(contour_errors.areas(estimated), contour_errors.areas(true))
        # Since the first scan that has a point of the label.
        seen = (k for k in labelled if len(contour_errors.points_of_target(scenario, scans, k)))
        confirmed = tracks[matched[at[0]]].confirmed
        found_scans = next((max(confirmed - int(k), 0) + 1 for k in seen), np.nan)
    in_order = matched[matched >= 0]
    return LabelScore(
        label=truth.name,
        range_m=_mean(contour_errors.centre_errors(poses[counted], camera[counted]), np.median),
        speed_m_s=speed,
        expected=int(moves and len(counted) >= LEAST_SCANS),
        frames=len(counted),
        tracked_frames=len(at),
        found_scans=found_scans,
        tracks=len(np.unique(in_order)),
        switches=int(np.sum(np.diff(in_order) != 0)),
        iou_box=_mean(iou),
        centre_m=_mean(contour_errors.centre_errors(means, poses[at])),
    )


def _box(track: Track, row: int) -> np.ndarray:
    """Corners (1, 4, 2) m of the box of a track at one scan."""
    scan = slice(row, row + 1)
    sizes = None if track.box_sizes is None else track.box_sizes[scan]
    return contour_errors.boxes(track.contours_world[scan], track.means[scan, :3], sizes)[0]


def _mean(values: np.ndarray, function=np.mean) -> float:
    return float(function(values)) if len(values) else np.nan
