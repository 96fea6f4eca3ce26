"""Stored runs: read with their experiment, compared with a new run, and played back on one page."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.border.files import read_arrays, read_bytes
from stixel_cli.border.origins import Origin
from stixel_cli.config.compose import Composition, compose, from_resolved
from stixel_cli.config.folders import OF_THE_MACHINE
from stixel_cli.config.own_options import admit_code, check_parameters, functions_of
from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.experiment.run import run_experiment
from stixel_cli.experiment.stages import experiment_graph
from stixel_cli.report.playback import playback_html
from stixel_cli.results import lineage
from stixel_cli.results.folder import origin_of
from stixel_cli.results.result import RunResult, listed, read_run
from stixel_cli.version import __version__


def read_stored_run(path: Path, overrides: tuple[str, ...] = ()) -> RunResult:
    """Read the result folder `path`, with its validated experiment and its lineage.

    The experiment has the executor and the cache of this machine. `overrides` may only change the
    groups `OF_THE_MACHINE`. UserError if it is not a result folder, or its configuration is not
    valid in this version.
    """
    run = read_run(path)
    own = compose(overrides).resolved
    resolved = {**run.settings, **{name: own[name] for name in OF_THE_MACHINE if name in own}}
    try:
        configuration = from_resolved(resolved)
    except ConfigurationError as fault:
        theirs = run.entry("versions").get("stixel")
        other = f" (the folder was made by stixel {theirs}, this is {__version__})"
        hint = "" if theirs in (None, __version__) else other
        raise UserError(f"{path / 'config.yaml'}: {fault}{hint}") from None
    composition = Composition(configuration, run.choices, run.overrides, resolved)
    return replace(
        run, settings=resolved, composition=composition, lineage=lineage.read_lineage(path)
    )


def has_pictures(run: RunResult) -> bool:
    """Whether the folder of a run has pictures. Runs of a sweep have them only on request."""
    return (run.folder / "figures").is_dir()


def trust_stored_run(run: RunResult, trusted: bool) -> list[str]:
    """Refuse a stored run of user-defined code, unless `trusted`, or of wrong parameters.

    What this user ran here is trusted while neither the folder nor the code has changed. Returns
    the names of `_changed_code`.
    """
    origin = origin_of(run.folder, trusted)
    if not origin.source and _changed_code(run):
        origin = Origin(str(run.folder), trusted)
    admit_code(run.settings, (), origin)
    if functions_of(run.settings):
        check_parameters(run.composition.configuration)
    return _changed_code(run)


def _changed_code(stored: RunResult) -> list[str]:
    """The user's modules, and files that they declare, that differ from those of a stored run."""
    before = None if stored.lineage is None else stored.lineage.code
    if before is None or not functions_of(stored.settings):
        return []
    graph = experiment_graph(stored.composition)
    codes = [nodes[0].identity.code for name in graph.stages if (nodes := graph.of_stage(name))]
    now = {name: digest for code in codes for name, digest in code.modules_of_user.items()}
    return [name for name in sorted(now) if before.get(name) != now[name]]


COMPARED = {"ego": "scenario", "truth": "scenario"}
COMPARED |= {name: name for name in ("scans", "track", "tracks", "scores")}
"""NPZ files that are compared, and the stage of each."""


@dataclass(frozen=True)
class FileDifference:
    """A file of the folder, the stage that gives it, and how it differs from the new result."""

    file: str
    stage: str
    what: str | None


@dataclass(frozen=True)
class Verification:
    """The comparison of a folder with a new run of its configuration."""

    files_compared: int
    files: tuple[FileDifference, ...]
    """The different ones, in the order of the data."""
    first_by_key: lineage.StageDifference | None
    """The first stage whose keys differ; None if all are equal, or if the folder has no lineage."""
    first_by_value: lineage.StageDifference | None
    """The first stage whose result differs; None if all are equal."""
    changes: tuple[str, ...]
    """Changed versions, revision and machine, one line each."""
    stages: list[dict[str, Any]]
    """Records of the new run, as in a manifest."""

    @property
    def identical(self) -> bool:
        """Whether every file with results equals the new result."""
        return not self.files


def verify_run(
    stored: RunResult, store: Store, old_store: Store, now: Mapping[str, Any], progress: Progress
) -> Verification:
    """Run a folder's configuration again, in `store`, and compare; an empty one computes all of it.

    `old_store` may still have results of the old run, to measure how much they differ; `now` is the
    `provenance` of this moment. UserError if a file of the folder is not valid; and the errors of
    `computed_stages`.
    """
    # Before the run, which may take long.
    paths = {name: stored.folder / f"{name}.npz" for name in COMPARED}
    arrays = {name: read_arrays(path) for name, path in paths.items() if path.exists()}
    new = run_experiment(stored.composition, progress, has_pictures(stored), store=store)
    compared = [FileDifference(*one) for one in _compared_files(stored, arrays, new)]
    files = tuple(file for file in compared if file.what is not None)
    by_key = by_value = None
    if stored.lineage is not None:
        graph = experiment_graph(stored.composition)
        by_key = lineage.first_changed_stage(stored.lineage, new.lineage, graph)
        by_value = _first_by_digest(stored.lineage, new.lineage, old_store, store, bool(files))
    if by_value is None and files:
        first, altered = files[0], "altered after the run: lineage.json matches the new result"
        causes = () if stored.lineage is None else (f"{first.file} was {altered}",)
        by_value = lineage.StageDifference(first.stage, f"{first.file}: {first.what}", causes)
    if by_value is not None and by_key is not None and not by_value.causes:
        by_value = replace(by_value, causes=by_key.causes)
    changes = tuple(_changes(stored, now))
    return Verification(len(compared), files, by_key, by_value, changes, new.stages)


def _compared_files(
    stored: RunResult, old: Mapping[str, Mapping[str, np.ndarray]], new: RunResult
) -> Iterator[tuple[str, str, str | None]]:
    """(file, stage, difference or None) of every file with results that the folder has."""
    arrays = new.arrays
    for name, content in old.items():
        yield f"{name}.npz", COMPARED[name], lineage.first_difference(content, arrays.get(name))
    yield "metrics.json", "scores", lineage.first_difference(stored.metrics, new.metrics)
    for name, data in new.pictures.items():
        picture = stored.folder / "figures" / name
        if picture.exists():
            yield f"figures/{name}", "pictures", lineage.first_difference(read_bytes(picture), data)


def _first_by_digest(
    old: lineage.Lineage, new: lineage.Lineage, old_store: Store, new_store: Store, guess: bool
) -> lineage.StageDifference | None:
    """The first stage with a node whose stored bytes differ, and whose value does.

    `guess` that it does where the old value is lost: an older version stored values differently.
    """
    for name, stage in new.stages.items():
        before = old.stages.get(name)
        if before is None or len(before.keys) != len(stage.keys):
            continue
        for i, (then, now) in enumerate(zip(before.digests, stage.digests, strict=True)):
            if then is None or now is None or then == now:
                continue
            try:
                # Equal values may be stored in other bytes: the values themselves decide.
                old_value, new_value = old_store.load(before.keys[i]), new_store.load(stage.keys[i])
                what = lineage.first_difference(old_value, new_value)
            except CacheError:
                if not guess:
                    continue
                what = "different bytes (by how much is unknown: the old result is not cached)"
            if what is not None:
                chunk = f"chunk {i + 1} of {len(stage.keys)}: " if len(stage.keys) > 1 else ""
                return lineage.StageDifference(name, chunk + what, ())
    return None


def _changes(stored: RunResult, now: Mapping[str, Any]) -> Iterator[str]:
    """Versions, machine and revision that changed since the run."""
    for name in ("versions", "machine"):
        old = stored.entry(name)
        for key in dict.fromkeys((*old, *now[name])):
            if old.get(key) != now[name].get(key):
                yield f"{key} {old.get(key, 'missing')} → {now[name].get(key, 'missing')}"
    then, today = stored.entry("git"), now["git"]
    if then.get("revision") != today["revision"]:
        yield f"git revision {str(then.get('revision'))[:12]} → {str(today['revision'])[:12]}"
    dirty = [when for when, git in (("then", then), ("now", today)) if git.get("dirty")]
    if dirty:
        yield f"git: uncommitted changes {' and '.join(dirty)}"


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
    for key, values in lineage.differing_settings(scenes).items():
        there = next(i for i, value in enumerate(values) if value != values[0])
        raise UserError(
            f"the runs must share one scene: {key} is {values[0]} in {labels[0]} and "
            f"{values[there]} in {labels[there]}"
        )
