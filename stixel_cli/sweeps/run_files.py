"""The files of a run's folder. They are small: large results stay in the cache under their keys."""

import json
import shlex
import traceback
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any

from stixel_cli.config.folders import PRESETS
from stixel_cli.engine.execute import Execution
from stixel_cli.engine.keys import digest
from stixel_cli.engine.store import Store
from stixel_cli.errors import UserError
from stixel_cli.evaluation.scores import Scores
from stixel_cli.files import read_json
from stixel_cli.results import lineage
from stixel_cli.results.folder import arrays_content
from stixel_cli.results.reader import json_text, yaml_text
from stixel_cli.results.result import RunResult
from stixel_cli.results.tables import score_columns
from stixel_cli.sweeps.folder import RUNS, SweepFolder


def run_files(
    planned: RunResult,
    scores: Scores,
    seconds: Mapping[str, float],
    notes: Mapping[str, Any],
    lineage_text: str,
) -> dict[str, str | bytes]:
    """Configuration, manifest, metrics, lineage and scores of a run, by file name.

    `seconds` are those of the computed nodes, by key; `notes` are further entries of the manifest.
    """
    # Each run that shares a computed node records it as computed.
    keys = planned.graph.ancestors(planned.targets)
    status = {key: "computed" if key in seconds else "cached" for key in keys}
    entries = dict(planned.manifest)
    index = entries.pop("run")
    manifest = {
        "command": shlex.join(["stixel", "run", *planned.overrides, *PRESETS.option]),
        **entries,
        **notes,
        "run": index,
        "results": list(planned.targets),
        "stages": Execution(planned.graph, status, seconds).stage_records(),
    }
    return {
        "config.yaml": yaml_of_parts(planned.settings),
        "manifest.json": json_text(manifest),
        "metrics.json": json_text(scores.metrics),
        lineage.FILE: lineage_text,
        "scores.npz": arrays_content(score_columns(scores)),
    }


def yaml_of_parts(resolved: Mapping[str, Any]) -> str:
    """The same as `yaml_text` of it, faster: runs of a sweep have most parts in common."""
    # As JSON, because 1, 1.0 and true are equal in Python.
    return "".join(_yaml_of_part(json.dumps({key: part})) for key, part in resolved.items())


@lru_cache(maxsize=1000)
def _yaml_of_part(part: str) -> str:
    return yaml_text(json.loads(part))


def failure_files(run: RunResult, node: str, first: int) -> dict[str, str]:
    """Configuration, cause and traceback of a run that failed or was skipped, by file name.

    `node` is the key of the failed node, and `first` the index of the first run that needs it.
    """
    failure = run.failure
    content = {
        "run": run.index,
        "status": run.status,
        "failed_in_run": first,
        "overrides": list(run.overrides),
        "stage": failure.stage,
        "node": failure.label,
        "key": node,
        "error": f"{type(failure.cause).__name__}: {failure.cause}",
    }
    text = failure.traceback_text or "".join(traceback.format_exception(failure.cause))
    files = {"config.yaml": yaml_text(run.settings), "failure.json": json_text(content)}
    return files | {"traceback.txt": text}


class RunLineages:
    """The lineages of runs; their code digests, four fifths of each, are stored once."""

    def __init__(self, store: Store, folder: SweepFolder):
        self._store = store
        self._folder = folder
        self._digests: dict[str, str] = {}
        self._written: set[str] = set()

    def text(self, planned: RunResult) -> str:
        """The lineage file of a complete run; writes its code file into the sweep's folder."""
        keys = planned.graph.ancestors(planned.targets)
        found = lineage.lineage_of(planned.graph, keys, self._store, self._digests)
        text = lineage.compact_json(found.code)
        name = digest(text)[:16]
        if name not in self._written:
            sources = lineage.stored_sources(found.sources).items()
            files = {f"{name}.json": text} | {f"{name}/{path}": source for path, source in sources}
            self._folder.write({f"{lineage.CODE_FOLDER}/{path}": files[path] for path in files})
            self._written.add(name)
        return lineage.compact_json(lineage.lineage_tree(found, name))


def remove_unused_code(folder: SweepFolder) -> None:
    """Remove code files that no run refers to any more; those that cannot be removed stay."""
    files = list((folder.path / lineage.CODE_FOLDER).glob("*.json"))
    if len(files) < 2:
        return
    used = set()
    for run in (folder.path / RUNS).glob("[0-9]*"):
        with suppress(UserError):
            used.add(str(read_json(run / lineage.FILE).get("code")))
    unused = [one for one in files if one.stem not in used]
    folder.remove(f"{lineage.CODE_FOLDER}/{n}" for one in unused for n in (one.name, one.stem))
