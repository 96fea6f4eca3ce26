"""Play back the runs of result folders on one page."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import run_experiment
from stixel_cli.report.playback import playback_html
from stixel_cli.results.lineage import differing_settings
from stixel_cli.results.result import RunResult, listed

SCENE = ("road_user", "path", "ego")
"""The groups that define the scene; with scans from a file, those files do."""

OF_SCENE = ("times", "ego_poses_world", "target_poses_world", "contours_target", "limb_poses")
"""What runs of one scene share of their ground truth."""


def folders_page(
    stored: Sequence[RunResult], labels: Sequence[str], progress: Progress
) -> tuple[str, list[str]]:
    """The page of stored runs of one scene, whose folders have the `labels`; notes for the user.

    Results that the cache lacks are computed; the page shows the new results. Where they differ
    from those of a folder, the page and the notes say so. UserError if the runs are not of one
    scene; and the errors of `computed_stages`.
    """
    check_one_scene(stored, labels)
    trackers = [one.choice("tracker") for one in stored]
    distinct = len(stored) > 1 and len(set(trackers)) == len(trackers)
    runs = []
    for one, name in zip(stored, trackers if distinct else labels, strict=True):
        run = run_experiment(one.composition, progress, pictures=False, camera=True)
        runs.append(replace(run, label=name, manifest=one.manifest, folder=one.folder))
    for label, run in zip(labels, runs, strict=True):
        pairs = [(getattr(runs[0].scenario, n), getattr(run.scenario, n)) for n in OF_SCENE]
        if not all(np.array_equal(*pair, equal_nan=True) for pair in pairs):
            raise UserError(
                f"the runs must share one scene: the paths in {labels[0]} and {label} differ, "
                "though their settings do not"
            )
    notes = [
        f"{label}: this version gives different results, which the page shows "
        f"(stixel verify {one.folder} explains why)"
        for label, one, run in zip(labels, stored, runs, strict=True)
        if run.metrics != one.metrics
    ]
    several = f"{listed([run.label for run in runs])} on one scene"
    title, names = (labels[0], ()) if len(runs) == 1 else (several, labels)
    return playback_html(runs, title, notes, names), notes


def check_one_scene(stored: Sequence[RunResult], labels: Sequence[str]) -> None:
    """Raise UserError with the first setting that differs, unless all runs share the scene."""
    scenes = []
    for one in stored:
        groups = ("measurement",) if one.settings["measurement"].get("kind") == "file" else SCENE
        scenes.append(RunResult(settings={group: one.settings[group] for group in groups}))
    for key, values in differing_settings(scenes).items():
        there = next(i for i, value in enumerate(values) if value != values[0])
        raise UserError(
            f"the runs must share one scene: {key} is {values[0]} in {labels[0]} and "
            f"{values[there]} in {labels[there]}"
        )
