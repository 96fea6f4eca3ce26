"""Runs made by hand for the page that plays them back."""

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
from stixel_cli.report.camera_frames import camera_frames
from stixel_cli.results.result import RunResult

SCANS = 12


def make_run(label="run", seed=0, with_camera=True, corners=60):
    """A run of `SCANS` scans; scan 5 is empty."""
    rng = np.random.default_rng(0)
    scenario = make_scenario(SCANS)
    scans = make_scans(scenario, rng)
    track = make_track(scenario, scans, np.random.default_rng(seed), corners)
    camera = ()
    if with_camera:
        _, pairs, _, _, stixels = make_camera_nouns(make_rig(), rng, first=0, count=SCANS)
        camera = (
            camera_frames(pairs, stixels, range(0, 10)),
            camera_frames(pairs, stixels, range(10, SCANS)),
        )
    composition = composed("simulated" if with_camera else "fabricated")
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


@cache
def composed(measurement):
    return compose([f"measurement={measurement}"])
