"""The files of a run's folder: small, for what is large stays in the cache under its key."""

import shlex
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.engine.errors import StageFailure
from stixel_cli.engine.execute import Execution, NodeRecord
from stixel_cli.evaluation.scores import Scores
from stixel_cli.results.lineage import FILE
from stixel_cli.results.tables import score_columns
from stixel_cli.results.text import json_text
from stixel_cli.sweeps.folder import yaml_text
from stixel_cli.sweeps.graphs import PlannedRun
from stixel_cli.sweeps.results import FAILED, SKIPPED
from stixel_cli.sweeps.runs import SweepRun


def run_files(
    planned: PlannedRun,
    scores: Scores,
    seconds: Mapping[str, float],
    notes: Mapping[str, Any],
    lineage: str,
) -> dict[str, str | Callable[[Path], None]]:
    """Configuration, manifest, metrics, lineage and scores of a run, by name.

    `seconds` are those of the nodes that were computed, by key; `notes` go into the manifest;
    `lineage` is the text of its file.
    """
    run = planned.run
    manifest = {
        "command": shlex.join(["stixel", "run", *run.overrides]),
        "overrides": list(run.overrides),
        "choices": run.composition.choices,
        "seed": run.seed,
        **notes,
        "run": run.index,
        "results": list(planned.targets),
        "stages": _stage_records(planned, seconds),
    }
    columns = score_columns(scores)
    return {
        "config.yaml": yaml_text(run.composition.resolved),
        "manifest.json": json_text(manifest),
        "metrics.json": json_text(scores.metrics),
        FILE: lineage,
        "scores.npz": lambda file: np.savez_compressed(file, **columns),
    }


def failure_files(run: SweepRun, node: str, failure: StageFailure, first: int) -> dict[str, str]:
    """What became of a run that is not there, by name.

    `node` is the key of the node that failed, and `first` the first run that needed it.
    """
    content = {
        "run": run.index,
        "status": FAILED if first == run.index else SKIPPED,
        "failed_in_run": first,
        "overrides": list(run.overrides),
        "stage": failure.stage,
        "node": failure.label,
        "key": node,
        "error": f"{type(failure.cause).__name__}: {failure.cause}",
    }
    text = failure.traceback_text or "".join(traceback.format_exception(failure.cause))
    return {
        "config.yaml": yaml_text(run.composition.resolved),
        "failure.json": json_text(content),
        "traceback.txt": text,
    }


def _stage_records(planned: PlannedRun, seconds: Mapping[str, float]) -> list[dict[str, Any]]:
    """The stages that a run needed, as in a run's manifest, with the keys of their results.

    What several runs share is told as computed in each of them.
    """
    graph = planned.graph
    records = {
        key: NodeRecord(
            key=key,
            stage=graph.nodes[key].stage.name,
            label=graph.nodes[key].label,
            status="computed" if key in seconds else "cached",
            seconds=round(seconds.get(key, 0.0), 4),
        )
        for key in graph.ancestors(planned.targets)
    }
    return Execution(graph, records).stage_records()
