"""What is asked of several runs, and the runs in several folders as a frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from stixel_cli.answers.answer import Answer
from stixel_cli.answers.runs import Runs
from stixel_cli.errors import UserError
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.report.compare import run_labels
from stixel_cli.results.differences import differing_settings, warnings
from stixel_cli.results.folder import PAGE
from stixel_cli.results.reader import check_folder
from stixel_cli.results.result import DONE, RunResult, read_scored_run


@dataclass(frozen=True)
class Asked:
    """What a page says of several runs: of a sweep, or of the runs in several folders.

    Attributes:
        answers: of one comparison, the main metric first.
        remarks: on the runs, each in one sentence.
        origin: `command`, `created` and `revision` of the runs; {} if they differ.
        player: the page that plays the runs back, if there is one.
    """

    title: str
    runs: Runs
    answers: Sequence[Answer]
    remarks: Sequence[str] = ()
    origin: Mapping[str, Any] = field(default_factory=dict)
    player: Path | None = None


def compared_runs(runs: Sequence[RunResult], labels: Sequence[str]) -> Runs:
    """One row a run, named by its label, with the settings in which they differ.

    Where a group is exchanged, such as the tracker, that is one column.
    """
    differing, settings = differing_settings(runs), {}
    # Of another option or kind, from which the group's other keys follow.
    exchanged = {key.removesuffix(".kind") for key in differing}
    for key, values in differing.items():
        group = key.partition(".")[0]
        if group not in exchanged:
            settings[key] = values
        elif key in (group, f"{group}.kind"):
            settings[group] = values
    names = dict.fromkeys(name for run in runs for name in run.metrics)
    metrics = {name: [run.metrics.get(name) for run in runs] for name in names}
    frame = pd.DataFrame(
        {
            **{"run": list(labels), **settings, "status": DONE},
            **{"folder": [str(run.folder) for run in runs]},
            **{name: pd.Series(values, dtype=float) for name, values in metrics.items()},
        }
    )
    default = {"compare": "run", "within": (), "over": ()}
    return Runs(frame.set_index("run", drop=False), ("run", *settings), default)


def asked_runs(
    folders: Sequence[Path], metrics: Sequence[str] = (), reference: str | None = None
) -> Asked:
    """What is asked of the runs in two folders or more.

    Raises:
        UserError: for one folder, or one that is no result folder.
    """
    if len(folders) < 2:
        check_folder(folders[0])
        raise UserError(
            f"{folders[0]}: is one run: name two or more, or a sweep; its page is "
            f"{folders[0] / PAGE}"
        )
    labels = run_labels(folders)
    read = [read_scored_run(folder) for folder in folders]
    runs = compared_runs(read, labels)
    verdicts = zip(labels, read, strict=True)
    remarks = [f"{label}: {' '.join(verdict(run.metrics))}" for label, run in verdicts]
    answers = runs.answers(metrics, reference=reference)
    return Asked(f"Comparison of {len(read)} runs", runs, answers, [*warnings(read), *remarks])
