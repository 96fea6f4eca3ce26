"""Runs of result folders, played back on one page."""

from collections.abc import Sequence

import numpy as np

from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.played_run import choice, played_run
from stixel_cli.experiment.recorded_run import told_in_one_line
from stixel_cli.experiment.run import Outcome, run_experiment
from stixel_cli.experiment.stored_run import StoredRun
from stixel_cli.report.playback import playback_html
from stixel_cli.results.reader import flat_settings
from stixel_cli.results.text import listed

SCENE = ("road_user", "path", "ego")
"""The groups that say what happens in a scene."""


def folders_page(
    stored: Sequence[StoredRun], labels: Sequence[str], progress: Progress | None = None
) -> tuple[str, list[str]]:
    """The page of one stored run, or of several of one scene, and what is to be said of them.

    What the cache lacks is computed; the page shows what comes out now. Where that is not what a
    folder holds, the page and the second value say so.

    Args:
        stored: the runs.
        labels: what each folder is called, all different.
        progress: told how far each is.

    Raises:
        UserError: if the runs are not of one scene, or one cannot be made.
        StageFailure: if a stage fails.
    """
    check_one_scene(stored, labels)
    outcomes = [_outcome(one, progress) for one in stored]
    for label, outcome in zip(labels[1:], outcomes[1:], strict=True):
        if not _same_scene(outcomes[0], outcome):
            raise UserError(
                f"two runs of one scene are needed: the paths in {labels[0]} and {label} differ, "
                "though their settings do not"
            )
    notes = [
        f"{label}: its results come out differently now; the page shows what comes out "
        f"(stixel verify {one.path} says why)"
        for label, one, outcome in zip(labels, stored, outcomes, strict=True)
        if outcome.scores.metrics != one.metrics
    ]
    names = _legend(stored, labels)
    runs = [
        played_run(name, one.composition, outcome, folder=label if len(stored) > 1 else None)
        for name, label, one, outcome in zip(names, labels, stored, outcomes, strict=True)
    ]
    title = labels[0] if len(runs) == 1 else f"{listed(names)} on one scene"
    return playback_html(runs, title, notes), notes


def check_one_scene(stored: Sequence[StoredRun], labels: Sequence[str]) -> None:
    """Raise UserError, which names the first setting that differs, unless all share the scene."""
    first = _scene_settings(stored[0])
    for label, one in zip(labels[1:], stored[1:], strict=True):
        other = _scene_settings(one)
        for key in dict.fromkeys((*first, *other)):
            here, there = first.get(key, "not set"), other.get(key, "not set")
            if here != there:
                raise UserError(
                    f"two runs of one scene are needed: {key} is {here} in {labels[0]} "
                    f"and {there} in {label}"
                )


def _scene_settings(stored: StoredRun) -> dict[str, str]:
    resolved = stored.composition.resolved
    return flat_settings({group: resolved[group] for group in SCENE})


def _same_scene(one: Outcome, other: Outcome) -> bool:
    names = ("times", "ego_poses_world", "target_poses_world", "contour_target")
    return all(
        np.array_equal(getattr(one.scenario, name), getattr(other.scenario, name)) for name in names
    )


def _outcome(stored: StoredRun, progress: Progress | None) -> Outcome:
    configuration = stored.composition.configuration
    store = open_store(configuration.cache)
    with told_in_one_line():
        return run_experiment(configuration, store, progress, pictures=False, camera=True)


def _legend(stored: Sequence[StoredRun], labels: Sequence[str]) -> list[str]:
    """What each run is called: its tracker, where that tells them apart, else its folder."""
    trackers = [choice(one.composition, "tracker") for one in stored]
    alike = len(stored) == 1 or len(set(trackers)) < len(trackers)
    return list(labels) if alike else trackers
