"""The findings of a study, kept in the cache: drawing its figures takes longer than all else."""

from collections.abc import Mapping
from dataclasses import fields
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.config.folders import conf_state, shipped_folder
from stixel_cli.engine.keys import canonical
from stixel_cli.engine.store import Store
from stixel_cli.engine.task import remembered
from stixel_cli.evaluation.scores import Scores
from stixel_cli.report.blocks import Findings
from stixel_cli.studies.data import StudyData, StudySweep
from stixel_cli.studies.file import StudyFile
from stixel_cli.sweeps.results import SweepResult


def findings_of_study(
    study: StudyFile, data: StudyData, results: Mapping[str, SweepResult], store: Store
) -> Findings:
    """The findings of a complete study: those in the store, if nothing that they depend on changed.

    A study from outside the package is always computed: its module may read any file.

    Args:
        study: with the module of its report.
        data: of its sweeps.
        results: of the sweeps, by name.
        store: of their results.

    Raises:
        UserError: if the study's module fails.
    """
    if not study.module.__name__.startswith("stixel_cli."):
        return study.findings(data)
    content = [
        [data.name, data.title, data.question, study.template_name],
        [_files(Path(__file__).parent / "templates"), _files(shipped_folder("pipelines"))],
        conf_state(),
        [_sweep(sweep, results[name]) for name, sweep in data.sweeps.items()],
    ]
    modules = [study.module.__name__, StudyFile.__module__]
    return remembered(store, "findings", modules, content, lambda: study.findings(data))


def _sweep(sweep: StudySweep, result: SweepResult) -> list[Any]:
    """All that a report can see of a sweep; the keys of its results stand for their content."""
    return [
        [sweep.name, list(sweep.keys)],
        [
            [
                [run.index, run.seed, list(run.setting.items()), canonical(run.configuration)],
                [list(run.metrics.items()), _scores(run.scores), list(run.cpu_seconds.items())],
                list(one.planned.targets),
            ]
            for run, one in zip(sweep.runs, result.runs, strict=True)
        ],
    ]


def _scores(scores: Scores) -> list[str]:
    """Digests of the errors over time."""
    values = (getattr(scores, field.name) for field in fields(scores))
    return [sha256(v.tobytes()).hexdigest() for v in values if isinstance(v, np.ndarray)]


def _files(folder: Path) -> dict[str, str]:
    """Digests of the files in a folder, by name."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(f.relative_to(folder)): sha256(f.read_bytes()).hexdigest() for f in files}
