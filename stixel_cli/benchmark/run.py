"""Run a tracker on the files of the sequences, as its author would, and time it."""

import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from stixel_cli.benchmark.data import Data, Given, npz
from stixel_cli.benchmark.packs import TRACKER, Machine, Tracker
from stixel_cli.benchmark.sequences import named, planned
from stixel_cli.config.compose import compose
from stixel_cli.engine.keys import Stage
from stixel_cli.errors import UserError
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.files import write_whole, written
from stixel_cli.own_code import loaded
from stixel_cli.results.folder import json_text
from stixel_cli.results.lineage import git_state
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.baselines.pyrecest_parameters import Name
from stixel_cli.tracking.start_scans import start_from_scans
from stixel_cli.tracking.track import InitialState, Track
from stixel_cli.version import __version__

OWN_START_SCANS = 10
"""With its own start, a tracker may use so many scans before the first that is scored."""
REFERENCE = "gp_ekf"


def tracker_overrides(tracker: str, further: Sequence[str] = ()) -> dict[str, Any]:
    """The settings that a name stands for: `contour`, `pyrecest:full_scgp`, `my_module:track`."""
    kind, _, name = tracker.partition(":")
    chosen = {"tracker": tracker}
    if kind == "pyrecest" and name in get_args(Name):
        chosen = {"tracker": kind, "tracker.name": name}
    for text in further:
        key, equals, value = text.partition("=")
        if not equals or not key.startswith("tracker."):
            raise UserError(f"{text}: must be tracker.KEY=VALUE: all else is of the sequences")
        chosen[key] = value
    return chosen


def run(
    tracker: str,
    further: Sequence[str],
    data: Data,
    start: str,
    folder: Path,
    note: Callable[[str], None],
) -> None:
    """Write the tracks of a tracker into a folder that `packs.pack` packs, and its `tracker.json`.

    Args:
        tracker, further: as in `tracker_overrides`.
        data: the sequences.
        start: `given` or `own`.
        folder: to write to.
        note: called with one line after each tenth of the sequences.
    """
    settings = tracker_overrides(tracker, further)
    stages = _track_stages(data.names, settings)
    # The first call compiles; a tracker that fails at once has a fault.
    first, _ = tracked(data, data.names[0], stages[0])
    for i, (name, stage) in enumerate(zip(data.names, stages, strict=True)):
        try:
            track, seconds = tracked(data, name, stage, start)
            arrays = track_arrays(track.smoothed or track) | {"seconds": np.array(seconds)}
        except UserError as fault:
            note(f"{fault}: all scans of the sequence are missing")
            arrays = no_track(len(data.given(name).scans))
        with written(folder):
            write_whole(folder / f"{name}.npz", npz(**arrays))
        if (i + 1) * 10 // len(data.names) > i * 10 // len(data.names):
            note(f"{i + 1} of {len(data.names)} sequences")
    commit = str(git_state()["revision"] or "")[:12]
    about = Tracker(
        name=" ".join([tracker, *further]),
        version=f"{__version__}+{commit}" if commit else __version__,
        settings=settings,
        code="",
        licence="",
        learnt_from="",
        causal=first.smoothed is None,
        per_class=False,
        start=start,
    )
    with written(folder):
        write_whole(folder / TRACKER, json_text(vars(about)))


def _track_stages(names: Sequence[str], settings: dict[str, Any]) -> list[Stage]:
    """The stage `track` of each sequence."""
    runs = planned(map(named, names), settings)
    stages = [{s.name: s for s in pipeline_stages(run.composition)}["track"] for run in runs]
    # The folders of the user's module.
    sys.path += [str(f) for f in stages[0].folders if str(f) not in sys.path]
    return stages


def tracked(data: Data, name: str, stage: Stage, start: str = "given") -> tuple[Track, float]:
    """The track of a sequence, and the seconds that it took.

    UserError in one line if the tracker, or its start, fails.
    """
    given = data.given(name)
    function, settings = loaded(stage.function), {**stage.settings, "prior": given.prior}
    begun = time.perf_counter()
    try:
        initial = own_start(given) if start == "own" else given.initial
        track = function(scans=given.scans, initial=initial, **settings)
    except Exception as error:
        reason = " ".join(str(error).split())[:300]
        raise UserError(f"{name}: the tracker failed: {type(error).__name__}: {reason}") from error
    return track, time.perf_counter() - begun


def own_start(given: Given) -> InitialState:
    """A start from the first scans alone, as `start=scans` has it; ValueError if there is none."""
    last = given.scans.offsets[OWN_START_SCANS]
    scans = replace(
        given.scans,
        times=given.scans.times[:OWN_START_SCANS],
        sensor_poses_world=given.scans.sensor_poses_world[:OWN_START_SCANS],
        offsets=given.scans.offsets[: OWN_START_SCANS + 1],
        points_world=given.scans.points_world[:last],
        covariances_world=given.scans.covariances_world[:last],
    )
    return start_from_scans(scans, compose(["start=scans"]).configuration.start, given.prior)


def track_arrays(track: Track) -> dict[str, np.ndarray]:
    """What a pack has of a track."""
    return {
        "means": track.means[:, :3],
        "covariances": track.covariances[:, :3, :3],
        "contours": track.contours_world.astype(np.float32),
        "contour_std": track.contour_std.astype(np.float32),
    }


def no_track(count: int) -> dict[str, np.ndarray]:
    """The arrays of a track without an estimate at any of `count` scans."""
    shapes = {"means": (3,), "covariances": (3, 3), "contours": (3, 2)}
    arrays = {name: np.full((count, *shape), np.nan) for name, shape in shapes.items()}
    return arrays | {"seconds": np.zeros(())}


def true_box(truth: Scenario) -> dict[str, np.ndarray]:
    """The arrays of a track that is the true box at the true pose: a row for comparison."""
    count = len(truth.times)
    return {
        "means": truth.target_poses_world,
        "covariances": np.tile(1e-6 * np.eye(3), (count, 1, 1)),
        "contours": truth.boxes_world.astype(np.float32),
        "seconds": np.zeros(()),
    }


def this_machine(data: Data) -> Machine:
    """This machine, with the time of the reference tracker on the first sequence of the data."""
    name = data.names[0]
    (stage,) = _track_stages([name], tracker_overrides(REFERENCE))
    seconds = min(tracked(data, name, stage)[1] for _ in range(3))
    scans = len(data.given(name).scans)
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    machine = f"{models[0] if models else platform.machine()}, {platform.system()}"
    return Machine(machine, os.cpu_count() or 1, round(1e3 * seconds / scans, 4))
