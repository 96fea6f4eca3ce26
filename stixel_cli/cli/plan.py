"""`stixel plan`: what a run or a sweep would compute, and how long it would take."""

import sys
from collections.abc import Sequence
from typing import Any

from stixel_cli.cli.run import with_workers
from stixel_cli.cli.terminal import print_table
from stixel_cli.engine.progress import duration
from stixel_cli.experiment.run import CAMERA, RESULTS
from stixel_cli.results.text import json_text
from stixel_cli.sweeps.design import Design
from stixel_cli.sweeps.graphs import SweepPlan
from stixel_cli.sweeps.runs import design_runs, sweep_design
from stixel_cli.sweeps.whole import planned_sweep

AS_RUN = (
    "what stixel run would compute, pictures and page with it; "
    "a sweep draws pictures only with --pictures"
)


def plan_command(
    overrides: Sequence[str],
    file: str | None,
    json: bool,
    workers: int | None = None,
    pictures: bool = False,
) -> int:
    """Print what a sweep, or a run, would compute; the exit code. Nothing is written.

    Where nothing has several values it is a run, as for `stixel explain`.

    Raises:
        UserError: for whatever the user can put right.
    """
    design = sweep_design(with_workers(overrides, workers), file, one_is_enough=True)
    runs = design_runs(design)
    if design.axes:
        plan, notes = planned_sweep(runs, None, pictures)
    else:
        plan, notes = planned_sweep(runs, None, pictures=True, nodes=(*RESULTS, CAMERA))
        notes = [AS_RUN, *notes]
    print_plan(plan, design, notes, json)
    return 0


def print_plan(plan: SweepPlan, design: Design, notes: Sequence[str], json: bool) -> None:
    """Print a plan, as JSON or for the eye."""
    content = plan_content(plan, design, notes)
    if json:
        sys.stdout.write(json_text(content))
        return
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    for axis in design.axes:
        values = [" ".join(step) for step in axis.steps]
        shown = ", ".join(values[:6]) + (", …" if len(values) > 6 else "")
        console.print(f"{axis.name}: {_many(len(values), 'value')}: {shown}", markup=False)
    for note in notes:
        console.print(f"note: {note}", markup=False)
    rows = [
        (
            stage.name,
            str(stage.nodes),
            str(stage.cached),
            str(stage.to_run),
            "" if not stage.to_run else "?" if stage.seconds is None else duration(stage.seconds),
        )
        for stage in plan.stages
    ]
    print_table(("stage", "nodes", "cached", "to run", "time"), rows, right=(1, 2, 3, 4))
    counts = content["nodes"]
    console.print(
        f"{_many(content['runs'], 'run')}, {content['runs_cached']} complete; "
        f"{_many(counts['all'], 'node')}, {counts['cached']} cached, {counts['to_run']} to run"
        f"{_estimate(plan, content)}"
    )


def plan_content(plan: SweepPlan, design: Design, notes: Sequence[str]) -> dict[str, Any]:
    """A plan in plain types."""
    configuration = plan.runs[0].run.composition.configuration
    seconds = plan.seconds(configuration.executor.workers)
    return {
        "runs": len(plan.runs),
        "runs_cached": plan.complete_runs(),
        "nodes": {
            "all": len(plan.needed),
            "cached": len(plan.needed) - len(plan.missing),
            "to_run": len(plan.missing),
        },
        "seconds": None if seconds is None else round(seconds, 1),
        "workers": configuration.executor.workers,
        "axes": [{"keys": list(axis.keys), "values": len(axis.steps)} for axis in design.axes],
        "notes": list(notes),
        "stages": [
            vars(stage) | {"seconds": None if stage.seconds is None else round(stage.seconds, 2)}
            for stage in plan.stages
        ],
    }


def _estimate(plan: SweepPlan, content: dict[str, Any]) -> str:
    if not plan.missing:
        return ""
    if content["seconds"] is None:
        return "; how long is not known yet"
    return f", about {duration(content['seconds'])} with {_many(content['workers'], 'worker')}"


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
