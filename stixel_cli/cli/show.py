"""`stixel ls` and `stixel show`: list runs and sweeps, print the record of one."""

import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stixel_cli.cli.completion import complete_folder
from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Json, RunOrSweep
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped
from stixel_cli.errors import UserError

if TYPE_CHECKING:
    from stixel_cli.results.result import RunResult

OF_IMAGES = ("correction", "row_difference_px")


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
    from stixel_cli.sweeps.index import SHOWN

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
    columns = ["folder", "created", "choices", "seed", "verdict", *shown]
    print_table(columns, map(_row, runs), right=(3, 5, 6, 7), leave_out=(1, 7, 3, 5, 6))
    return 0


def _json(run: "RunResult") -> dict[str, Any]:
    from stixel_cli.evaluation.verdict import word

    return {
        "path": str(run.folder),
        "kind": "sweep" if run.is_sweep else "run",
        "created": str(run.manifest.get("created", "")),
        "choices": _differences(run),
        "overrides": run.overrides,
        "swept": run.setting,
        "seed": run.seed,
        "verdict": word(run.metrics),
        "metrics": run.metrics,
        "fault": None if run.failure is None else str(run.failure),
    }


def _differences(run: "RunResult") -> str:
    from stixel_cli.sweeps.index import differing

    try:
        return differing(run)
    except UserError as fault:
        tell(str(fault))
        return "a sweep"


def _row(run: "RunResult") -> list[str]:
    from stixel_cli.evaluation.verdict import word
    from stixel_cli.report.metrics import shown_value
    from stixel_cli.sweeps.index import SHOWN

    seed = "" if run.seed is None else str(run.seed)
    shown = [shown_value(n, run.metrics[n]) if n in run.metrics else "" for n in SHOWN]
    created = str(run.manifest.get("created", ""))[:16].replace("T", " ")
    # A line of the table may break at the spaces.
    choices = re.sub(r",(?=\S)", ", ", _differences(run))
    return [str(run.folder), created, choices, seed, word(run.metrics) or "", *shown]


def show(folder: RunOrSweep, json: Json = False) -> int:
    """Show one run or sweep: its origin, scores and stages.

    Example: stixel show results/contour
    """
    from stixel_cli.evaluation.verdict import verdict
    from stixel_cli.report.metrics import score_table
    from stixel_cli.results.reader import SWEEP_FILE, flat_settings
    from stixel_cli.results.result import read_run

    if (folder / SWEEP_FILE).exists():
        return _show_sweep(folder, json)
    run = read_run(folder)
    manifest, metrics = run.manifest, run.metrics
    settings = flat_settings(run.settings)
    if json:
        answer = {"folder": str(folder), "settings": settings, "metrics": metrics}
        print_json(answer | {"verdict": verdict(metrics), "manifest": manifest})
        return 0
    print_table(("run", str(folder)), _provenance(run))
    say("")
    for sentence in verdict(metrics):
        say_wrapped(sentence)
    say("")
    print_table(*score_table(metrics))
    say("")
    print_table(("stage", "status", "nodes", "seconds", "key"), _stages(manifest), right=(2, 3))
    return 0


def _show_sweep(folder: Path, json: bool) -> int:
    """Print the request of a sweep, the status of its runs, and its answer."""
    from stixel_cli.sweeps.folder import SweepFolder

    notes = SweepFolder(folder).request().notes
    with_status = SweepFolder(folder).rows()
    statuses = Counter(row.get("status") or "missing" for row in with_status)
    if json:
        print_json({"folder": str(folder), "notes": dict(notes), "runs": with_status})
        return 0
    runs = ", ".join(f"{count} {status}" for status, count in statuses.items())
    rows = [("runs", runs or "not started")]
    rows += [(name, str(notes[name])) for name in ("command", "created") if name in notes]
    print_table(("sweep", str(folder)), rows)
    if statuses["done"]:
        from stixel_cli.cli.sweep import print_answers
        from stixel_cli.sweeps.page import read_sweep

        say("")
        print_answers(read_sweep(folder)[0])
    return 0


def _provenance(run: "RunResult") -> list[tuple[str, str]]:
    from stixel_cli.results.lineage import shown_revision

    manifest = run.manifest
    rows = [
        (name, str(manifest[name]))
        for name in ("command", "rerun_of", "created", "seconds", "seed", "workers", *OF_IMAGES)
        if name in manifest
    ]
    choices = " ".join(f"{group}={option}" for group, option in run.choices.items())
    rows.append(("choices", choices))
    revision = shown_revision(run.entry("git"))
    rows += [] if revision is None else [("git", revision)]
    for name in ("versions", "machine"):
        rows.append((name, ", ".join(f"{k} {v}" for k, v in run.entry(name).items())))
    return rows


def _stages(manifest: dict[str, Any]) -> list[list[str]]:
    stages = manifest.get("stages")
    missing = {"name": "?", "status": "?", "nodes": "", "seconds": "", "key": ""}
    rows = [missing | s for s in stages if isinstance(s, dict)] if isinstance(stages, list) else []
    return [[str(row[name])[: 12 if name == "key" else None] for name in missing] for row in rows]
