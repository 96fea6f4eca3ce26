"""`stixel sweep`: run all combinations of several values."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from stixel_cli.cli import options
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
    resume: options.Resume = None,
    over: options.Over = None,
    pictures: options.Pictures = False,
    fail_fast: options.flag("--fail-fast", "Stop at the first failed run.") = False,
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
    from stixel_cli.results.made_here import origin_of
    from stixel_cli.sweeps.design import SEED
    from stixel_cli.sweeps.graphs import plan_sweep
    from stixel_cli.sweeps.index import update_index
    from stixel_cli.sweeps.runs import sweep_design
    from stixel_cli.sweeps.whole import new_sweep, resumed_sweep

    started = time.perf_counter()
    words = options.with_workers(overrides or [], workers)
    if resume is not None:
        given = {"--from": file, "--name": name, "--over": over}
        given |= {"--pictures": pictures or None, "--dry-run": dry_run or None}
        for option in (option for option, value in given.items() if value is not None):
            raise UserError(f"--resume continues the sweep of that folder: leave out {option}")
        names = origin_of(resume, trust_code)
        result = resumed_sweep(resume, words, names, True, note=tell, fail_fast=fail_fast)
    else:
        check_results(results, name)
        plan = plan_sweep(sweep_design(words, file, trust_code, over or SEED), pictures)
        if dry_run:
            print_plan(plan, json)
            return 0
        result = new_sweep(plan, results, name, True, tell, not json, fail_fast)
    _report(result, json, time.perf_counter() - started)
    update_index(results if resume is None else resume.absolute().parent)
    return 0 if result.complete else INCOMPLETE


def _report(result: "SweepResult", json: bool, seconds: float) -> None:
    from stixel_cli.results.folder import PAGE

    done = result.count("done")
    if json:
        from stixel_cli.answers.render import records

        print_json(
            {
                "folder": str(result.folder.absolute()),
                "complete": result.complete,
                "nodes": {"computed": result.computed, "cached": result.cached},
                "runs": result.records,
                # Without a run there is nothing to ask.
                "summary": records(result.table.answers(result.table.metrics)) if done else [],
            }
        )
    else:
        if done:
            print_answers(result)
        say(
            f"{done} of {len(result.runs)} runs done; nodes: "
            f"{result.computed} computed, {result.cached} cached; {seconds:.1f} s"
        )
        say(result.folder if not done else result.folder / PAGE)
    sys.stdout.flush()
    if not result.complete:
        _tell_what_is_missing(result)


def print_answers(result: "SweepResult") -> None:
    """Print the first answer, and the main metrics of the options, the best first."""
    from stixel_cli.answers.render import overview

    answers = result.table.answers()
    cells = overview(answers, intervals=1)
    say_wrapped(answers[0].sentence)
    for note in answers[0].notes:
        say_wrapped(note)
    rows = [
        [f"{text} *" if mark else text for text, mark in zip(*both, strict=True)]
        for both in zip(cells.rows[:_MOST_SHOWN], cells.best, strict=False)
    ]
    first = cells.numbers[0]
    last = range(len(cells.header) - 1, first + 1, -1)
    print_table(cells.header, rows, right=cells.numbers, leave_out=last)
    more = len(cells.rows) - _MOST_SHOWN
    if more > 0:
        say(f"{counted(more, 'more option')}: summary.md")
    if any(True in marks for marks in cells.best):
        say("*: shown to be the best")


def _tell_what_is_missing(result: "SweepResult") -> None:
    from stixel_cli.results.result import FAILED, SKIPPED
    from stixel_cli.sweeps.folder import SweepFolder

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
    for line in (*lines, last):
        tell(line)
    command = SweepFolder(result.folder).resume_command(result.runs[0].overrides)
    print(command, file=sys.stderr)  # noqa: T201
