"""The files of a point's folder: small, for what is large stays in the cache under its key."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.engine.records import Execution, NodeRecord
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.folder import json_text, score_columns
from stixel_cli.sweeps.folder import yaml_text
from stixel_cli.sweeps.graphs import PlannedPoint


def point_files(
    planned: PlannedPoint,
    scores: Scores,
    seconds: Mapping[str, float],
    notes: Mapping[str, Any],
) -> dict[str, str | Callable[[Path], None]]:
    """Configuration, manifest, metrics and scores of a point, by name.

    `seconds` are those of the nodes that were computed, by key; `notes` go into the manifest.
    """
    point = planned.point
    manifest = {
        "command": shlex.join(["stixel", "run", *point.overrides]),
        "overrides": list(point.overrides),
        "choices": point.composition.choices,
        "seed": point.seed,
        **notes,
        "point": point.index,
        "results": list(planned.targets),
        "stages": _stage_records(planned, seconds),
    }
    columns = score_columns(scores)
    return {
        "config.yaml": yaml_text(point.composition.resolved),
        "manifest.json": json_text(manifest),
        "metrics.json": json_text(scores.metrics),
        "scores.npz": lambda file: np.savez_compressed(file, **columns),
    }


def _stage_records(planned: PlannedPoint, seconds: Mapping[str, float]) -> list[dict[str, Any]]:
    """The stages that a point needed, as in a run's manifest, with the keys of their results.

    What several points share is told as computed in each of them.
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
