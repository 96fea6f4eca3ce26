"""`stixel ls`: list runs and sweeps."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stixel_cli.cli.completion import complete_folder
from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Json
from stixel_cli.cli.terminal import print_json, print_table

if TYPE_CHECKING:
    from stixel_cli.results.reader import ListedRun

SHOWN = ("centre_rmse_m", "iou_mean", "iou_box_mean")


def ls(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder to search.",
            metavar="DIR",
            autocompletion=complete_folder,
            show_default=True,
        ),
    ] = Path("results"),
    json: Json = False,
) -> int:
    """List runs and sweeps, oldest first, with what differs from the default.

    Runs of a sweep are listed with the values that differ between them: give the sweep's folder.
    """
    from stixel_cli.evaluation.metric_table import metric
    from stixel_cli.results.reader import list_runs

    runs = list_runs(folder)
    if json:
        print_json(
            [vars(run) | {"path": str(run.path), "choices": _differences(run)} for run in runs]
        )
        return 0
    for run in runs:
        if run.fault is not None:
            tell(run.fault)
    if not runs:
        tell(f"{folder}: no result folders")
        return 0
    rows = map(metric, SHOWN)
    shown = [f"{row.short_label}, {row.shown_unit}".rstrip(", ") for row in rows]
    columns = ["folder", "created", "choices", "seed", *shown]
    print_table(columns, map(_row, runs), right=(3, 4, 5, 6))
    return 0


def _differences(run: "ListedRun") -> str:
    from stixel_cli.config.run_names import differences, short_setting

    if run.swept:
        return " ".join(short_setting(key, value) for key, value in run.swept.items())
    # The seed has a column of its own.
    others = [text for text in run.overrides if not text.startswith("seed=")]
    return " ".join(differences(run.choices, others))


def _row(run: "ListedRun") -> list[str]:
    from stixel_cli.report.metrics import shown_value

    what = "a sweep" if run.kind == "sweep" else _differences(run)
    seed = "" if run.seed is None else str(run.seed)
    shown = [shown_value(n, run.metrics[n]) if n in run.metrics else "" for n in SHOWN]
    return [str(run.path), run.created[:19].replace("T", " "), what, seed, *shown]
