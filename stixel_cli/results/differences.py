"""Differences of runs: of values, of keys with their causes, and of settings."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from stixel_cli.engine.graph import Graph, Node
from stixel_cli.errors import printable
from stixel_cli.evaluation.metric_table import NO_VALUE
from stixel_cli.results.lineage import Lineage, StageLineage, settings_digest
from stixel_cli.results.result import RunResult, flat_settings


def first_difference(old: Any, new: Any, name: str = "") -> str | None:
    """The first difference of two values in one line, with its size; None if they are equal.

    Floats are equal if their bits are; NaN equals NaN. `name` is the name of the value.
    """
    if type(old) is not type(new):
        text = f"a {type(old).__name__} became a {type(new).__name__}"
    elif is_dataclass(old):
        parts = ({f.name: getattr(value, f.name) for f in fields(value)} for value in (old, new))
        return first_difference(*parts, name)
    elif isinstance(old, list | tuple):
        return first_difference(dict(enumerate(old)), dict(enumerate(new)), name)
    elif isinstance(old, Mapping) and old.keys() == new.keys():
        names = {key: f"{name}.{key}" if name else str(key) for key in old}
        inner = (first_difference(old[key], new[key], names[key]) for key in old)
        return next((difference for difference in inner if difference is not None), None)
    elif isinstance(old, Mapping):
        odd = next(key for key in (*old, *new) if (key in old) != (key in new))
        text = f"{odd} is in only one of the two"
    elif isinstance(old, np.ndarray):
        text = _array_difference(old, new)
    elif old == new or (isinstance(old, float) and math.isnan(old) and math.isnan(new)):
        return None
    elif isinstance(old, bytes):
        text = "other bytes"
    else:
        text = f"{printable(repr(old))} became {printable(repr(new))}"
    return f"{name}: {text}" if name and text else text


def _array_difference(old: np.ndarray, new: np.ndarray) -> str | None:
    if old.shape != new.shape:
        return f"its shape {old.shape} became {new.shape}"
    if old.dtype != new.dtype:
        return f"its type {old.dtype} became {new.dtype}"
    if old.tobytes() == new.tobytes():
        return None
    if old.dtype.kind not in "biufc":
        return "other values"
    same = (old == new) | ((old != old) & (new != new))
    if same.all():
        return "zeros of other signs or other NaNs"
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(new[~same].astype(np.complex128) - old[~same].astype(np.complex128))
    finite = apart[np.isfinite(apart)]
    most = f", by up to {finite.max():.3g}" if finite.size else ", not finite"
    return f"{np.count_nonzero(~same)} of {same.size} values differ{most}"


MOST_CAUSES = 8
ALTERED = "its settings differ from those of the run: was config.yaml altered?"


@dataclass(frozen=True)
class StageDifference:
    """The name of a stage that changed, how its key or result differs, and known causes."""

    stage: str
    what: str
    causes: tuple[str, ...]


def first_changed_stage(old: Lineage, new: Lineage, graph: Graph) -> StageDifference | None:
    """The first stage of `new` whose keys differ from those of `old`; None if all are equal.

    `graph` is the graph of `new`.
    """
    for name, stage in new.stages.items():
        before = old.stages.get(name)
        if before is None:
            return StageDifference(name, "the folder's run did not have this stage", ())
        if before.keys != stage.keys:
            node = graph.of_stage(name)[0]
            causes = tuple(_causes(before, stage, old.code, node))
            return StageDifference(name, "its keys differ", causes)
    return None


def _causes(
    before: StageLineage,
    after: StageLineage,
    code: Mapping[str, str] | None,
    node: Node,
) -> Iterator[str]:
    """Causes why a stage with the same inputs has another key."""
    for package, version in after.versions.items():
        then = before.versions.get(package)
        if then != version:
            yield f"{package} {then or 'missing'} → {version or 'missing'}"
    for path, content in (after.files or {}).items():
        then = (before.files or {}).get(path)
        if then is not None and then != content:
            yield f"the content of {path} changed"
    if before.settings != _settings_with_files(node, before):
        files = ", ".join(after.files or {}) if before.files is None else ""
        yield f"{ALTERED[:-1]}, or {files}?" if files else ALTERED
    if code is None:
        yield "unknown code changes: the folder does not record its code"
        return
    if before.versions.get("python") != after.versions.get("python"):
        # Another Python has another syntax tree, and so another digest, of the same code.
        return
    changed = [
        f"{module} {'was edited' if module in code else 'is new'}"
        for module, digest in sorted(node.identity.code.modules.items())
        if code.get(module) != digest
    ]
    yield from changed[:MOST_CAUSES]
    if len(changed) > MOST_CAUSES:
        yield f"and {len(changed) - MOST_CAUSES} more modules"


def _settings_with_files(node: Node, before: StageLineage) -> str:
    """The digest of the current settings with the old content of the files."""
    then, paths = before.files or {}, [str(path) for path in node.stage.files]
    files = [then[path] for path in paths] if set(paths) == set(then) else None
    return settings_digest(node.identity.content, files)


def differing_settings(runs: Sequence[RunResult]) -> dict[str, list[str]]:
    """The settings that differ: key to the value of each run, as text."""
    flat = [flat_settings(run.settings) for run in runs]
    # The chosen option of each group whose settings have no `kind`.
    tables = [
        {g: option for g, option in run.choices.items() if f"{g}.kind" not in settings} | settings
        for run, settings in zip(runs, flat, strict=True)
    ]
    keys = list(dict.fromkeys(key for table in tables for key in table))
    groups = list(dict.fromkeys(key.partition(".")[0] for key in keys))
    keys.sort(key=lambda key: groups.index(key.partition(".")[0]))
    values = {key: [table.get(key, NO_VALUE) for table in tables] for key in keys}
    return {key: of_runs for key, of_runs in values.items() if len(set(of_runs)) > 1}


_SCENE = ("road_user", "path", "ego", "world", "rig", "source")


def warnings(runs: Sequence[RunResult]) -> list[str]:
    """Reasons why a difference of the metrics may not be one of the method."""
    found = []
    ends = [float(run.scores.times[-1]) if len(run.scores.times) else 0.0 for run in runs]
    if len(set(ends)) > 1 or len({len(run.scores.times) for run in runs}) > 1:
        shown = ", ".join(f"{end:g} s" for end in ends)
        found.append(f"The durations differ ({shown}): the metrics are over other scans.")
    groups = [g for g in _SCENE if len({str(run.settings.get(g)) for run in runs}) > 1]
    if groups:
        views = "the metrics compare other motions or views"
        found.append(f"The scenes differ ({', '.join(groups)}): {views}.")
    if len({str(run.settings.get("seed")) for run in runs}) > 1:
        found.append("The seeds differ: a difference may be that of the noise.")
    return found
