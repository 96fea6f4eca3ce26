"""`stixel sweep`: run all combinations of several values."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stixel_cli.border import Origin
from stixel_cli.cli import options
from stixel_cli.cli.completion import complete_folder
from stixel_cli.cli.errors import tell
from stixel_cli.cli.plan import print_plan
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped
from stixel_cli.errors import UserError, counted

if TYPE_CHECKING:
    from stixel_cli.sweeps.results import SweepResult

INCOMPLETE = 1
_MOST_SHOWN = 10


def sweep(
    overrides: options.SweepOverrides = None,
    file: options.FromFile = None,
    name: options.Name = None,
    results: options.Results = Path("results"),
    workers: options.Workers = None,
    shuffle: Annotated[
        int | None,
        typer.Option(min=0, metavar="SEED", help="Shuffle the order of the runs with this seed."),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Resume a sweep: run what is missing or failed; accepts overrides of executor "
            "and cache only.",
            autocompletion=complete_folder,
        ),
    ] = None,
    over: options.Over = None,
    pictures: options.Pictures = False,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="Stop at the first failed run.")
    ] = False,
    dry_run: options.DryRun = False,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Run all combinations of several values.

    Each combination of values and seed is a run. Stages that runs share are computed once. A
    failing run does not stop the others, unless --fail-fast is given. The folder has a table with
    one row per run, statistics over the seeds, and one figure per axis. The exit code is 1 if runs
    are missing at the end.

    \b
    Examples:
      stixel sweep tracker.length_scale=0.2,0.4,0.8 seed='range(0,10)'
      stixel sweep road_user='glob(*)' path=turn,s_curve measurement=fabricated
      stixel sweep --resume results/sweep-20260101-120000
    """
    from stixel_cli.results.folder import check_results
    from stixel_cli.sweeps.design import SEED
    from stixel_cli.sweeps.graphs import planned_sweep
    from stixel_cli.sweeps.index import update_index
    from stixel_cli.sweeps.runs import design_runs, sweep_design
    from stixel_cli.sweeps.whole import new_sweep, resumed_sweep

    started = time.perf_counter()
    words = options.with_workers(overrides or [], workers)
    if resume is not None:
        given = {"--from": file, "--name": name, "--shuffle": shuffle}
        given |= {"--over": over, "--pictures": pictures or None, "--dry-run": dry_run or None}
        for option in (option for option, value in given.items() if value is not None):
            raise UserError(f"--resume continues the sweep of that folder: leave out {option}")
        names = Origin(str(resume), trust_code)
        result = resumed_sweep(resume, words, names, True, note=tell, fail_fast=fail_fast)
    elif dry_run:
        check_results(results, name)
        design = sweep_design(words, file, shuffle, trust_code=trust_code, over=over or SEED)
        plan = planned_sweep(design_runs(design, imports=False), shuffle, pictures)
        print_plan(plan, design.axes, json)
        return 0
    else:
        design = sweep_design(words, file, shuffle, trust_code=trust_code, over=over or SEED)
        result = new_sweep(design, results, name, pictures, True, tell, not json, fail_fast)
    _report(result, json, time.perf_counter() - started)
    update_index(result.folder.absolute().parent)
    return 0 if result.complete else INCOMPLETE


def _report(result: "SweepResult", json: bool, seconds: float) -> None:
    if json:
        from stixel_cli.sweeps.results import summary_records

        answer = {
            "folder": str(result.folder.absolute()),
            "complete": result.complete,
            "nodes": {"computed": result.computed, "cached": result.cached},
            "runs": result.records,
            "summary": summary_records(result),
            "incomplete": result.incomplete,
        }
        print_json(answer)
    else:
        if result.statistics:
            _print_statistics(result)
        say(
            f"{result.count('done')} of {len(result.runs)} runs done; nodes: "
            f"{result.computed} computed, {result.cached} cached; {seconds:.1f} s"
        )
        say(result.folder)
    sys.stdout.flush()
    if not result.complete:
        _tell_what_is_missing(result)


def _print_statistics(result: "SweepResult") -> None:
    """Print the main metrics of the first settings; all of them are in the summary."""
    from stixel_cli.evaluation.metric_table import over_runs
    from stixel_cli.report.metrics import best, with_interval
    from stixel_cli.report.tables import label_of
    from stixel_cli.sweeps.figures import SHOWN

    by_setting = result.statistics
    names = [over_runs(name) for name in SHOWN]
    names = [n for n in names if any(n in row and row[n].n for row in by_setting.values())]
    keys, rows = list(dict(next(iter(by_setting)))), []
    # Of single runs the best is marked. Means of more are ranked on the page, with intervals.
    single = all(row[name].n == 1 for row in by_setting.values() for name in names)
    marks = {n: best(n, [row[n].mean for row in by_setting.values()]) for n in names if single}
    for i, (setting, row) in enumerate(list(by_setting.items())[: 2 * _MOST_SHOWN]):
        cells = []
        for name in names:
            one = row[name]
            mark = " *" if marks.get(name) and marks[name][i] else "  " if single else ""
            cells.append(f"{with_interval(one.mean, one.low, one.high)}{mark}")
        n = max((row[name].n for name in names), default=0)
        rows.append((*(value for _, value in setting), str(n), *cells))
    header = [*keys, "n", *map(label_of, names)]
    numbers = range(len(keys), len(header))
    # The IoU stays longer than the orientation, which is before it.
    print_table(header, rows, right=numbers, leave_out=[*numbers[:3:-1], *numbers[2:4]])
    known = any(row[name].low is not None for row in by_setting.values() for name in names)
    interval = f"Mean over n {result.units} "
    interval += "[95 % interval]" if known else "(no interval below n = 4)"
    interval = "One run per row; * is the best, which may be due to chance" if single else interval
    more = len(by_setting) - 2 * _MOST_SHOWN
    others = f" {more} more settings and" if more > 0 else ""
    page = "" if result.folder is None else f"; a page: stixel report {result.folder}"
    say_wrapped(f"{interval};{others} all metrics: summary.csv, .md, .tex{page}")


def _tell_what_is_missing(result: "SweepResult") -> None:
    from stixel_cli.results.result import FAILED, SKIPPED
    from stixel_cli.sweeps.folder import SweepFolder
    from stixel_cli.sweeps.results import incomplete_label

    lines = []
    for status in (FAILED, SKIPPED):
        runs = [run for run in result.runs if run.status == status]
        for run in runs[:_MOST_SHOWN]:
            reason = " ".join(str(run.failure).split())
            lines.append(f"run {run.index} {status} ({run.label}): {reason}")
        if len(runs) > _MOST_SHOWN:
            lines.append(f"{len(runs) - _MOST_SHOWN} more runs {status}, see runs.csv")
    lacking = len(result.runs) - result.count("done")
    last = f"{lacking} of {len(result.runs)} runs are missing"
    where = ""
    if result.statistics:
        where = f" for {counted(len(result.incomplete), 'setting')}"
        last += f": {'; '.join(map(incomplete_label, result.incomplete[:_MOST_SHOWN]))}"
        more = len(result.incomplete) - _MOST_SHOWN
        last += f"; and {more} more" if more > 0 else ""
    for line in (*lines, f"no statistics yet{where}: {last}"):
        tell(line)
    command = SweepFolder(result.folder).resume_command(result.runs[0].overrides)
    print(command, file=sys.stderr)  # noqa: T201
