"""`stixel ls`: the result folders below a folder."""

import sys
from pathlib import Path

from stixel_cli.cli.errors import tell
from stixel_cli.cli.terminal import print_table
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.metrics import format_value
from stixel_cli.results.run_list import ListedRun, list_runs
from stixel_cli.results.text import json_text

SHOWN = ("centre_rmse_m", "iou_mean")


def ls_command(folder: Path, json: bool) -> int:
    """Print the result folders below `folder`, oldest first; the exit code.

    Raises:
        UserError: if there is no such folder.
    """
    runs = list_runs(folder)
    if json:
        sys.stdout.write(json_text([vars(run) | {"path": str(run.path)} for run in runs]))
        return 0
    for run in runs:
        if run.fault is not None:
            tell(run.fault)
    if not runs:
        tell(f"{folder}: no result folders")
        return 0
    shown = [f"{metric(name).short_label}, {metric(name).unit}".rstrip(", ") for name in SHOWN]
    columns = ["folder", "created", "choices", "seed", *shown]
    print_table(columns, map(_row, runs), right=(3, 4, 5))
    return 0


def _row(run: ListedRun) -> list[str]:
    what = "a sweep" if run.kind == "sweep" else run.choices
    seed = "" if run.seed is None else str(run.seed)
    shown = [format_value(run.metrics[name]) if name in run.metrics else "" for name in SHOWN]
    return [str(run.path), run.created[:19].replace("T", " "), what, seed, *shown]
