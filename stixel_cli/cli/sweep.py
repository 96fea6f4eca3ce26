"""`stixel sweep`: many runs, from overrides or a file to a sweep's folder."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from stixel_cli.cli.errors import tell
from stixel_cli.cli.plan import print_plan
from stixel_cli.cli.run import with_workers
from stixel_cli.cli.terminal import print_table
from stixel_cli.errors import UserError
from stixel_cli.results.folder import check_name
from stixel_cli.results.text import json_text
from stixel_cli.sweeps.results import FAILED, SKIPPED, SweepResult
from stixel_cli.sweeps.resume import resume_command
from stixel_cli.sweeps.runs import design_runs, sweep_design
from stixel_cli.sweeps.whole import new_sweep, planned_sweep, resumed_sweep

INCOMPLETE = 1
_MOST_SHOWN = 10


def sweep_command(
    overrides: Sequence[str],
    file: str | None,
    name: str | None,
    results: Path,
    workers: int | None,
    json: bool,
    dry_run: bool,
    resume: Path | None,
    shuffle: int | None,
    pictures: bool = False,
) -> int:
    """Run a sweep, or go on with one; the exit code is 1 if a run is not there in the end.

    Args:
        overrides: in Hydra's grammar, with its sweeps.
        file: that describes axes, see `stixel_cli.sweeps.file`.
        name: of the sweep's folder; None for one made of the file's name and the time.
        results: the folder in which that is made.
        workers: short for the override `executor.workers`.
        json: print the result as JSON.
        dry_run: print what would be computed, and write nothing.
        resume: the folder of a sweep to go on with; then nothing else is given but `workers`, and
            overrides of executor and cache.
        shuffle: seed of the order in which the runs run; None for theirs.
        pictures: draw every run's pictures.

    Raises:
        UserError: for whatever the user can put right, before anything is computed.
        SweepInterrupted: by Ctrl-C.
    """
    started = time.perf_counter()
    if resume is not None:
        _refuse_beside_resume(file, name, shuffle, pictures, dry_run)
        result = resumed_sweep(resume, workers, visible=True, overrides=overrides, note=tell)
    else:
        overrides = with_workers(overrides, workers)
        if dry_run:
            check_name(results, name)
            design = sweep_design(overrides, file, shuffle)
            plan, notes = planned_sweep(design_runs(design), shuffle, pictures)
            print_plan(plan, design, notes, json)
            return 0
        result = new_sweep(
            overrides, file, results, name, shuffle, pictures, visible=True, note=tell
        )
    _report(result, json, time.perf_counter() - started)
    return 0 if result.complete else INCOMPLETE


def _refuse_beside_resume(
    file: str | None, name: str | None, shuffle: int | None, pictures: bool, dry_run: bool
) -> None:
    given = {
        "--from": file is not None,
        "--name": name is not None,
        "--shuffle": shuffle is not None,
        "--pictures": pictures,
        "--dry-run": dry_run,
    }
    for what, is_given in given.items():
        if is_given:
            raise UserError(f"--resume goes on with what the folder asks for: leave out {what}")


def _report(result: SweepResult, json: bool, seconds: float) -> None:
    if json:
        sys.stdout.write(json_text(_answer(result)))
    else:
        from rich.console import Console

        console = Console(highlight=False, soft_wrap=True)
        if result.statistics:
            _print_statistics(console, result)
        console.print(
            f"{result.count('done')} of {len(result.runs)} runs done; nodes: "
            f"{result.computed} computed, {result.cached} cached; {seconds:.1f} s"
        )
        console.print(str(result.folder), markup=False)
    sys.stdout.flush()
    if not result.complete:
        _tell_what_is_missing(result)


def _answer(result: SweepResult) -> dict[str, Any]:
    from stixel_cli.sweeps.tables import summary_records

    return {
        "folder": str(result.folder.absolute()),
        "complete": result.complete,
        "nodes": {"computed": result.computed, "cached": result.cached},
        "runs": result.records,
        "summary": summary_records(result.statistics),
        "incomplete": [vars(one) for one in result.incomplete],
    }


def _print_statistics(console: Any, result: SweepResult) -> None:
    """The first of the shown metrics by setting; all of it is in the summary."""
    from stixel_cli.report.metrics import format_value
    from stixel_cli.sweeps.figures import SHOWN
    from stixel_cli.sweeps.tables import heading

    by_setting: dict[tuple, dict[str, Any]] = {}
    for one in result.statistics:
        by_setting.setdefault(tuple(one.setting.items()), {})[one.metric] = one
    names = [name for name in SHOWN if any(name in row for row in by_setting.values())]
    spread = any(one.low is not None for one in result.statistics)
    keys = list(result.runs[0].planned.run.setting)
    header = [*keys, "n", *(heading(name) for name in names)]
    rows = []
    for setting, row in list(by_setting.items())[: 2 * _MOST_SHOWN]:
        cells = []
        for name in names:
            one = row[name]
            half = "" if one.low is None else f" ± {format_value(one.mean - one.low)}"
            cells.append(f"{format_value(one.mean)}{half}")
        n = max((row[name].n for name in names), default=0)
        rows.append((*(value for _, value in setting), str(n), *cells))
    print_table(header, rows, right=range(len(keys), len(header)))
    more = len(by_setting) - 2 * _MOST_SHOWN
    console.print(
        ("Mean over seeds ± half of the 95 % interval" if spread else "One seed each: no interval")
        + (f"; {more} more settings, and" if more > 0 else ";")
        + " all metrics: summary.csv, .md, .tex"
    )


def _tell_what_is_missing(result: SweepResult) -> None:
    lines = []
    for status in (FAILED, SKIPPED):
        runs = [run for run in result.runs if run.status == status]
        for one in runs[:_MOST_SHOWN]:
            run = one.planned.run
            reason = " ".join(str(one.failure).split())
            lines.append(f"run {run.index} {status} ({run.label}): {reason}")
        if len(runs) > _MOST_SHOWN:
            lines.append(f"{len(runs) - _MOST_SHOWN} more runs {status}, see runs.csv")
    lacking = len(result.runs) - result.count("done")
    where = f"{lacking} of {len(result.runs)} runs are not there"
    if result.statistics:
        named = "; ".join(one.label for one in result.incomplete[:_MOST_SHOWN])
        more = len(result.incomplete) - _MOST_SHOWN
        named += f"; and {more} more" if more > 0 else ""
        settings = "setting" if len(result.incomplete) == 1 else "settings"
        lines.append(
            f"{where}: no statistics of {len(result.incomplete)} {settings} that they belong to: "
            f"{named}"
        )
    else:
        lines.append(f"no statistics: {where}")
    for line in lines:
        tell(line)
    print(resume_command(result.folder), file=sys.stderr)  # noqa: T201
