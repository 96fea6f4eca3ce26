"""Run a tracker on the files of the sequences, as its author would, and time it."""

import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

from stixel_cli.benchmark.packs import TRACKER
from stixel_cli.benchmark.sequences import Data, SequenceData, named, npz, planned
from stixel_cli.border.origins import TYPED, write_whole, written
from stixel_cli.border.own_code import loaded
from stixel_cli.config.compose import compose
from stixel_cli.config.overrides import read_overrides
from stixel_cli.engine.keys import Stage
from stixel_cli.errors import UserError
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.results.folder import json_text
from stixel_cli.results.lineage import provenance
from stixel_cli.tracking.baselines.pyrecest import Name
from stixel_cli.tracking.several import start_from_scans
from stixel_cli.tracking.track import Track
from stixel_cli.version import __version__

OWN_START = ("start=scans",)
"""The overrides of a start from the scans before the first that is scored."""


def run(
    tracker: str, further: Sequence[str], own: bool, data: Data, note: Callable[[str], None]
) -> Path:
    """Write the tracks of a tracker, and `tracker.json`, into a folder; return it.

    `further` are overrides of its keys; with `own` it starts from the first scans. `note` gets one
    line for each sequence in which it fails.
    """
    settings, words = tracker_settings(tracker, further), [tracker, *further]
    start, ending = ("own", ["own-start"]) if own else ("given", [])
    folder = Path("-".join([*words, *ending]).replace(":", "-").replace("/", "-"))
    stages = track_stages(data.names, settings)
    # The first call compiles; a tracker that fails at once has a fault.
    first, _ = tracked(data.read(data.names[0]), stages[0])
    about = {"name": " ".join(words), "settings": settings, "start": start, "per_class": False}
    about |= {"version": f"{__version__}+{str(provenance()['git']['revision'])[:12]}"}
    about |= {"causal": first.smoothed is None, "code": "", "licence": "", "learnt_from": ""}
    with written(folder):
        for name, stage in zip(data.names, stages, strict=True):
            given = data.read(name)
            try:
                arrays = track_arrays(*tracked(given, stage, start))
            except UserError as fault:
                note(f"{name}: all scans are missing: {fault}")
                arrays = no_track(len(given.scans))
            write_whole(folder / f"{name}.npz", npz(**arrays))
        write_whole(folder / TRACKER, json_text(about))
    return folder


def tracker_settings(tracker: str, further: Iterable[str] = ()) -> dict[str, Any]:
    """The settings that a name, such as `contour` or `pyrecest:full_scgp`, and overrides mean."""
    kind, _, name = tracker.partition(":")
    chosen = {"tracker": tracker}
    if kind == "pyrecest" and name in get_args(Name):
        chosen = {"tracker": kind, "tracker.name": name}
    for one in read_overrides(further, TYPED):
        if not one.key.startswith("tracker."):
            raise UserError(f"{one.key}: must be a key of tracker: all else is of the sequences")
        chosen[one.key] = one.value
    return chosen


def track_stages(names: Sequence[str], settings: dict[str, Any]) -> list[Stage]:
    """The stage `track` of each sequence."""
    runs = planned(map(named, names), settings)
    stages = [{s.name: s for s in pipeline_stages(run.composition)}["track"] for run in runs]
    # The folders of the user's module.
    sys.path += [str(f) for f in stages[0].folders if str(f) not in sys.path]
    return stages


def tracked(given: SequenceData, stage: Stage, start: str = "given") -> tuple[Track, float]:
    """The track of a sequence, and the seconds that it took; UserError if it or its start fails."""
    function, settings = loaded(stage.function), {**stage.settings, "prior": given.prior}
    begun, initial = time.perf_counter(), given.initial
    try:
        if start == "own":
            own = compose(OWN_START).configuration.start
            initial = start_from_scans(given.scans, own, given.prior)
        track = function(scans=given.scans, initial=initial, **settings)
    except Exception as error:
        reason = " ".join(str(error).split())[:300]
        raise UserError(f"the tracker failed: {type(error).__name__}: {reason}") from error
    return track, time.perf_counter() - begun


def track_arrays(track: Track, seconds: float) -> dict[str, np.ndarray]:
    """The arrays of a pack: of the smoothed track, if there is one."""
    track = track.smoothed or track
    states = {"means": track.means[:, :3], "covariances": track.covariances[:, :3, :3]}
    contours = {"contours": track.contours_world, "contour_std": track.contour_std}
    return states | contours | {"seconds": np.array(seconds)}


def no_track(count: int) -> dict[str, np.ndarray]:
    """The arrays of a track without an estimate at any of `count` scans."""
    shapes = {"means": (3,), "covariances": (3, 3), "contours": (3, 2)}
    arrays = {name: np.full((count, *shape), np.nan) for name, shape in shapes.items()}
    return arrays | {"seconds": np.zeros(())}


def this_machine(data: Data) -> dict[str, Any]:
    """This machine, and the time of the reference tracker on the first sequence of the data."""
    given, (stage,) = data.read(data.names[0]), track_stages(data.names[:1], {"tracker": "gp_ekf"})
    reference = 1e3 * min(tracked(given, stage)[1] for _ in range(3)) / len(given.scans)
    return {"machine": provenance()["machine"], "reference_ms": round(reference, 4)}
