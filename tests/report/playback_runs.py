"""Runs made by hand for the page that plays them back."""

from dataclasses import replace
from functools import cache

import numpy as np
from report_nouns import (
    make_camera_nouns,
    make_rig,
    make_scans,
    make_scenario,
    make_scores,
    make_track,
)

from stixel_cli.config.compose import compose
from stixel_cli.pictures.camera import camera_frames
from stixel_cli.recordings.types import LabelTruth
from stixel_cli.results.result import RunResult
from stixel_cli.stixels.types import Objects
from stixel_cli.tracking.track import ObjectTrack

SCANS = 12
OVER_SCANS = (
    *("times", "means", "covariances", "contours_world", "contour_std"),
    *("nis", "nis_degrees_of_freedom"),
)
"""The arrays of a track with a row a scan."""


def make_run(label="run", seed=0, with_camera=True, corners=60):
    """A run of `SCANS` scans; scan 5 is empty."""
    rng = np.random.default_rng(0)
    scenario = make_scenario(SCANS)
    scans = make_scans(scenario, rng)
    track = make_track(scenario, scans, np.random.default_rng(seed), corners)
    camera = ()
    if with_camera:
        rig = make_rig()
        _, *nouns = make_camera_nouns(rig, rng, first=0, count=SCANS)
        parts = (range(0, 10), range(10, SCANS))
        camera = tuple(camera_frames(*nouns, rig, *composed_grid(), frames) for frames in parts)
    composition = composed("stixels" if with_camera else "fabricated")
    scores = make_scores(scenario, track)
    return RunResult(
        settings=composition.resolved,
        manifest={"choices": composition.choices | {"tracker": label}, "stages": []},
        metrics=scores.metrics,
        composition=composition,
        scenario=scenario,
        scans=scans,
        track=track,
        scores=scores,
        camera=camera,
        label=label,
    )


def with_objects(run):
    """The run with one object at scan 0, two at each other one."""
    counts = [1] + [2] * (SCANS - 1)
    boxes = np.array([[4 + k, 20 + k, 10, 30] for k in range(sum(counts))], dtype=np.int32)
    objects = Objects(
        first=0,
        offsets=np.cumsum([0, *counts]),
        boxes=boxes,
        corners_ego=np.zeros((len(boxes), 4, 2)),
        counts=np.full(len(boxes), 4),
        of_stixels=np.zeros(0, np.int32),
    )
    return replace(run, objects=(objects,))


def with_several_tracks(run):
    """The run with two tracks, of scans 3 to 5 and of all scans, and a label, and no single track.

    The class of the second is certain.
    """
    whole, label = run.track, LabelTruth("7", "car", run.scenario)
    short = replace(
        whole,
        **{name: getattr(whole, name)[3:6] for name in OVER_SCANS},
        used_offsets=whole.used_offsets[3:7] - whole.used_offsets[3],
        used_points=whole.used_points[slice(*whole.used_offsets[[3, 6]])],
    )
    probabilities = {"car": np.full(SCANS, 0.995), "cyclist": np.full(SCANS, 0.005)}
    tracks = (
        ObjectTrack(3, 5, short),
        ObjectTrack(0, 6, replace(whole, class_probabilities=probabilities)),
    )
    without = replace(
        run.scenario,
        target_poses_world=np.full((SCANS, 3), np.nan),
        target_rates_world=np.full((SCANS, 3), np.nan),
    )
    return replace(run, track=None, tracks=tracks, truths=(label,), scenario=without)


@cache
def composed(measurement):
    return compose([f"measurement={measurement}"])


def composed_grid():
    """The parameters of the road and of the occupancy grid."""
    configuration = composed("stixels").configuration
    return configuration.road, configuration.occupancy
