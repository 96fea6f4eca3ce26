"""`stixel compare`: settings that differ beside metrics that differ, on the terminal."""

import sys
from pathlib import Path

from stixel_cli.cli.terminal import print_table
from stixel_cli.errors import UserError
from stixel_cli.report.compare import differing_settings, metric_rows, run_labels
from stixel_cli.results.result import read_scored_run
from stixel_cli.results.text import json_text


def compare_command(folders: list[Path], json: bool) -> int:
    """Print what two or more runs do not have in common; the exit code.

    Raises:
        UserError: if there are fewer than two, or one of them is not to be read.
    """
    if len(folders) < 2:
        raise UserError("stixel compare puts runs side by side: name two result folders or more")
    labels = run_labels(folders)
    runs = [read_scored_run(folder) for folder in folders]
    settings, _ = differing_settings(runs)
    metrics = {name: [run.metrics.get(name) for run in runs] for name in _metric_names(runs)}
    differing = {name: values for name, values in metrics.items() if len(set(values)) > 1}
    if json:
        answer = {
            "folders": [str(folder) for folder in folders],
            "settings": {key: dict(zip(labels, values, strict=True)) for key, values in settings},
            "metrics": {k: dict(zip(labels, v, strict=True)) for k, v in differing.items()},
        }
        sys.stdout.write(json_text(answer))
        return 0
    if settings:
        print_table(("setting", *labels), [(key, *values) for key, values in settings])
    else:
        sys.stdout.write("the settings are the same\n")
    sys.stdout.write("\n")
    rows = [
        (
            f"{row['label']}, {row['unit']}" if row["unit"] else row["label"],
            *map(_cell, row["cells"]),
        )
        for row in metric_rows(runs)
        if row["name"] in differing
    ]
    if rows:
        print_table(("metric (* is the best)", *labels), rows, right=range(1, 1 + len(runs)))
    else:
        sys.stdout.write("the metrics are the same\n")
    return 0


def _metric_names(runs) -> list[str]:
    return list(dict.fromkeys(name for run in runs for name in run.metrics))


def _cell(cell: tuple[str, bool]) -> str:
    text, is_best = cell
    return f"{text} *" if is_best else f"{text}  "
