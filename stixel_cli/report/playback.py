"""Play back one run, or several of one scene, on a self-contained page.

The page consists of the files `templates/playback.*` and one block of JSON. Every run writes such
a page, so this module imports neither Matplotlib nor OpenCV.
"""

import base64
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from stixel_cli.evaluation.scan_errors import LOW_OVERLAP
from stixel_cli.evaluation.scores import SERIES
from stixel_cli.evaluation.verdict import LEAST_ODDS, badges, verdict
from stixel_cli.measurements.scans import Scans
from stixel_cli.pictures.uncertainty import normalised_chi_square_bounds, target_radius
from stixel_cli.report.metrics import LABEL_COLUMNS, label_rows
from stixel_cli.report.playback_values import (
    ellipses,
    facts_of,
    headline_of,
    millimetres,
    noise_of,
    numbers,
    origin_of,
    rounded_poses,
    summary_of,
)
from stixel_cli.report.static_page import filled_page
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.results.result import RunResult
from stixel_cli.stixels.types import Objects
from stixel_cli.tracking.track import Track

IMAGE_BUDGET = 6_300_000
"""Characters of encoded images on a page. Longer runs show every 2nd, 3rd, … frame."""

MOST_ELLIPSES = 60_000
"""With more points than this, the page shows no standard deviations of points."""

SCRIPTS = ("paths", "map", "camera", "charts", "legend", "time")
"""The files `templates/playback_*.js`, in the order of the page's one function."""


def playback_html(
    runs: Sequence[RunResult], title: str, notes: Sequence[str] = (), folders: Sequence[str] = ()
) -> str:
    """The page of one or more computed runs of one scene; the same runs give the same bytes.

    Args:
        runs: their `label` is their name in the legend.
        notes: lines below the title.
        folders: name of each run's folder; empty to show no folders.
    """
    scripts = [f"playback_{name}.js" for name in SCRIPTS]
    data = playback_data(runs, title, notes, folders)
    style = ["playback.css"]
    return filled_page(__package__, "playback.html", title, data, style=style, script=scripts)


def playback_data(
    runs: Sequence[RunResult], title: str, notes: Sequence[str] = (), folders: Sequence[str] = ()
) -> dict[str, Any]:
    """The page's data in JSON's types; None for values that are not finite.

    Lengths are whole millimetres and headings 1e-4 rad. Scans and images that several runs share
    are stored once, and each run has their index.
    """
    scans: list[dict[str, Any]] = []
    cameras: list[dict[str, Any]] = []
    played = []
    for i, run in enumerate(runs):
        facts = [("folder", folders[i])] if folders else []
        shared = {
            "scan": _place(scans, _scan(run.scans)),
            "camera": _place(cameras, _camera(run.camera)) if run.camera else None,
        }
        shared["headline"] = headline_of(run) if len(runs) == 1 and run.track else []
        played.append(_run(run, [*facts, *facts_of(run)]) | shared)
    scenario, first = runs[0].scenario, runs[0].track or runs[0].tracks[0].track
    with_truth = bool(scenario.known.any())
    return {
        "title": title,
        "notes": list(notes),
        "times": numbers(scenario.times, 6),
        "ego": rounded_poses(scenario.ego_poses_world),
        "target": rounded_poses(scenario.target_poses_world),
        "contours": [millimetres(contour.ravel()) for contour in scenario.contours_target],
        "limbPoses": scenario.limb_poses.tolist(),
        "known": with_truth,
        "truths": [
            {"name": one.name, "boxes": [millimetres(b.ravel()) for b in one.scenario.boxes_world]}
            for one in runs[0].truths
        ],
        "extent": round(1000.0 * target_radius(first, scenario)),
        "lowOverlap": LOW_OVERLAP,
        "leastOdds": LEAST_ODDS,
        "series": [
            asdict(series) | {"name": name}
            for name, series in SERIES.items()
            if (with_truth and not (scenario.only_box and name == "iou"))
            or any(np.isfinite(getattr(run.scores, name)).any() for run in runs)
        ],
        "neesBounds": numbers(normalised_chi_square_bounds(np.array([2])).ravel(), 4),
        "runs": played,
        "scans": scans,
        "cameras": cameras,
    }


def _run(run: RunResult, facts: Sequence[tuple[str, str]]) -> dict[str, Any]:
    scores = run.scores
    configuration = run.composition.configuration
    field_of_view, rig = configuration.field_of_view, configuration.rig
    several = [
        {
            "first": one.first,
            "nis": numbers(one.track.normalised_nis, 4),
            "classes": {c: float(p[-1]) for c, p in (one.track.class_probabilities or {}).items()},
            **_track(one.track, run.scans, one.first),
        }
        for one in run.tracks
    ]
    return {
        **({} if run.track is None else _track(run.track, run.scans)),
        "noise": noise_of(run),
        "label": run.label,
        "facts": [list(fact) for fact in facts],
        "fieldOfView": field_of_view and [round(bearing, 6) for bearing in field_of_view],
        "rig": {
            "focal": rig.focal,
            "focalV": rig.focal_v,
            "u0": rig.u0,
            "v0": rig.v0,
            "height": rig.camera_height,
            "pitch": rig.pitch_radians,
        },
        "badges": badges(scores.metrics),
        "origin": origin_of(run),
        "summary": summary_of(scores.metrics),
        "verdict": verdict(scores.metrics),
        "labels": [list(LABEL_COLUMNS), *map(list, label_rows(scores.labels))],
        "errors": {
            name: numbers(series.factor * getattr(scores, name), 4)
            for name, series in SERIES.items()
        },
        "boxes": _boxes(run.objects),
        "tracks": several,
    }


def _track(track: Track, scans: Scans, first: int = 0) -> dict[str, Any]:
    """What the page shows of a track from scan `first` on."""
    used = [
        track.used_points[start:stop] - scans.offsets[first + i]
        for i, (start, stop) in enumerate(pairwise(track.used_offsets))
    ]
    low, high = normalised_chi_square_bounds(track.nis_degrees_of_freedom)
    return {
        "poses": rounded_poses(track.means),
        "centre": ellipses(track.covariances[:, :2, :2]),
        "contours": [millimetres(c.ravel()) for c in track.contours_world],
        "std": [millimetres(row) for row in track.contour_std],
        "used": [rows.tolist() for rows in used],
        "nisBounds": [numbers(low, 3), numbers(high, 3)],
    }


def _boxes(objects: Sequence[Objects]) -> list[list[int]] | None:
    """left, right, top, base (px) of the objects of each frame, in one list; None without any."""
    frames = ((one, i) for one in objects for i in range(len(one.offsets) - 1))
    return [one.boxes[one.rows(i)].ravel().tolist() for one, i in frames] if objects else None


def _scan(scans: Scans) -> dict[str, Any]:
    rows, shown = [scans.rows(k) for k in range(len(scans))], None
    if len(scans.points_world) <= MOST_ELLIPSES:
        shown = [ellipses(scans.covariances_world[these]) for these in rows]
    points = [millimetres(scans.points_world[these].ravel()) or [] for these in rows]
    return {"points": points, "ellipses": shown}


def _camera(chunks: tuple[CameraFrames, ...]) -> dict[str, Any]:
    """Images and stixels of every n-th frame, for the smallest n that keeps to the budget."""
    where = [(chunk, i) for chunk in chunks for i in range(len(chunk.offsets) - 1)]
    images = {
        name: [base64.b64encode(one).decode("ascii") for c in chunks for one in c.images[name]]
        for name in chunks[0].images
    }
    sizes = np.sum([list(map(len, texts)) for texts in images.values()], axis=0)
    every = 1
    while every < len(where) and sizes[::every].sum() > IMAGE_BUDGET:
        every += 1
    shown = where[::every]
    return {
        "width": chunks[0].width,
        "height": chunks[0].height,
        "every": every,
        "frames": [chunk.first + i for chunk, i in shown],
        "images": {name: texts[::every] for name, texts in images.items()},
        "stixels": [_stixels(chunk, i) for chunk, i in shown],
    }


def _stixels(chunk: CameraFrames, index: int) -> list[int]:
    """left, right, top, base (px) and depth (cm) of each stixel, in one list."""
    rows = slice(int(chunk.offsets[index]), int(chunk.offsets[index + 1]))
    depth = np.rint(100.0 * np.clip(np.nan_to_num(chunk.depth[rows]), 0.0, 1e4))
    columns = (chunk.left[rows], chunk.right[rows], chunk.top[rows], chunk.base[rows], depth)
    return np.stack(columns, axis=1).astype(np.int64).ravel().tolist()


def _place(known: list[dict[str, Any]], value: dict[str, Any]) -> int:
    """Index of a value among the known ones; a new value is added to them."""
    if value not in known:
        known.append(value)
    return known.index(value)
