"""`stixel compare`: print the settings and metrics that differ between runs."""

from typing import Annotated

import typer

from stixel_cli.cli.options import Folders, Json
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped
from stixel_cli.errors import UserError

CHANCE = (
    "One run per column: a difference may be due to chance. NEES, NIS: the best is nearest to 1 "
    "(0.5 and 2 are equally near); farther from 1 there is no best"
)


def compare(
    folders: Folders,
    code: Annotated[
        bool,
        typer.Option("--code", help="Also print the modules in which two runs differ."),
    ] = False,
    json: Json = False,
) -> int:
    """Show the settings and metrics in which two or more runs differ.

    Example: stixel compare results/simulated results/fabricated
    """
    if len(folders) < 2:
        raise UserError(f"compare needs two or more result folders, got {len(folders)}")
    if code and len(folders) > 2:
        raise UserError(f"--code compares two result folders, got {len(folders)}")
    from stixel_cli.report.compare import metric_rows, run_labels
    from stixel_cli.results.differences import code_differences, differing_settings
    from stixel_cli.results.result import read_scored_run

    labels = run_labels(folders)
    from_third = range(len(labels), 2, -1)
    runs = [read_scored_run(folder) for folder in folders]
    settings, _ = differing_settings(runs)
    names = dict.fromkeys(name for run in runs for name in run.metrics)
    metrics = {name: [run.metrics.get(name) for run in runs] for name in names}
    differing = {name: values for name, values in metrics.items() if len(set(values)) > 1}
    changed = code_differences(*folders, tuple(labels)) if code else []
    if json:
        answer = {
            "folders": [str(folder) for folder in folders],
            "settings": {key: dict(zip(labels, values, strict=True)) for key, values in settings},
            "metrics": {k: dict(zip(labels, v, strict=True)) for k, v in differing.items()},
        }
        if code:
            answer["code"] = changed
        print_json(answer)
        return 0
    if settings:
        rows = [(key, *values) for key, values in settings]
        print_table(("setting", *labels), rows, leave_out=from_third)
    else:
        say("the settings are the same")
    say("")
    rows = [
        (", ".join(filter(None, (row["label"], row["unit"]))), *map(_cell, row["cells"]))
        for row in metric_rows(runs)
        if row["name"] in differing
    ]
    if rows:
        header, right = ("metric (* is the best)", *labels), range(1, 1 + len(labels))
        print_table(header, rows, right, leave_out=from_third)
    say_wrapped(CHANCE if rows else "the metrics are the same")
    if code:
        say("", *(changed or ["the code is the same"]))
    return 0


def _cell(cell: tuple[str, bool]) -> str:
    text, is_best = cell
    return f"{text} *" if is_best else f"{text}  "
