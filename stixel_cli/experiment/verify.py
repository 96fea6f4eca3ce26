"""Check that a result folder can be reproduced; if not, find the first difference and its cause."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stixel_cli.engine.errors import CacheError
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.experiment.run import has_pictures, run_experiment
from stixel_cli.experiment.stages import experiment_graph
from stixel_cli.files import read_arrays, read_bytes
from stixel_cli.results import lineage
from stixel_cli.results.result import RunResult

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
