"""`stixel ls`: list runs and sweeps."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stixel_cli.cli.completion import complete_folder
from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Json
from stixel_cli.cli.terminal import counted, print_json, print_table
from stixel_cli.errors import UserError

if TYPE_CHECKING:
    from stixel_cli.results.result import RunResult

MOST_AXES = 5
"""Axes of a sweep in its line."""

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
    """List runs and sweeps, oldest first, with the settings that differ from the default.

    A sweep is one line with its values. To list its runs, give its folder.
    """
    from stixel_cli.evaluation.metric_table import metric
    from stixel_cli.results.result import list_runs

    runs = list_runs(folder)
    if json:
        print_json(list(map(_json, runs)))
        return 0
    for run in runs:
        if run.failure is not None:
            tell(str(run.failure))
    if not runs:
        tell(f"{folder}: no result folders")
        return 0
    rows = map(metric, SHOWN)
    shown = [f"{row.short_label}, {row.shown_unit}".rstrip(", ") for row in rows]
    columns = ["folder", "created", "choices", "seed", *shown]
    print_table(columns, map(_row, runs), right=(3, 4, 5, 6))
    return 0


def _json(run: "RunResult") -> dict[str, Any]:
    return {
        "path": str(run.folder),
        "kind": "sweep" if _is_sweep(run) else "run",
        "created": str(run.manifest.get("created", "")),
        "choices": _differences(run),
        "overrides": run.overrides,
        "swept": run.setting,
        "seed": run.seed,
        "metrics": run.metrics,
        "fault": None if run.failure is None else str(run.failure),
    }


def _is_sweep(run: "RunResult") -> bool:
    return run.failure is None and not (run.folder / "manifest.json").exists()


def _differences(run: "RunResult") -> str:
    from stixel_cli.experiment.run_names import differences, short_setting

    if _is_sweep(run):
        return _swept(run.folder)
    if run.setting:
        return " ".join(short_setting(key, value) for key, value in run.setting.items())
    # The seed has a column of its own.
    others = [text for text in run.overrides if not text.startswith("seed=")]
    return " ".join(differences(run.choices, others))


def _swept(folder: Path) -> str:
    """`tracker=gp_ekf,contour seed=0..9, 20 runs`."""
    from stixel_cli.config.texts import split_override
    from stixel_cli.experiment.run_names import swept_setting
    from stixel_cli.sweeps.folder import SweepFolder

    try:
        request = SweepFolder(folder).request()
    except UserError as fault:
        tell(str(fault))
        return "a sweep"
    given = [dict(map(split_override, overrides)) for overrides in request.runs]
    axes = [
        swept_setting(keys, list(dict.fromkeys(run[keys[0]] for run in given)))
        for keys in request.axes
        if keys
    ]
    if len(axes) > MOST_AXES:
        axes = [*axes[:MOST_AXES], f"and {len(axes) - MOST_AXES} more"]
    runs = counted(len(request.runs), "run")
    return ", ".join([" ".join(axes), runs] if axes else [runs])


def _row(run: "RunResult") -> list[str]:
    from stixel_cli.report.metrics import shown_value

    seed = "" if run.seed is None else str(run.seed)
    shown = [shown_value(n, run.metrics[n]) if n in run.metrics else "" for n in SHOWN]
    created = str(run.manifest.get("created", ""))[:19].replace("T", " ")
    return [str(run.folder), created, _differences(run), seed, *shown]
