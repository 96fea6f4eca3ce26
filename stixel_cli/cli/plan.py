"""`stixel plan`: count the nodes that a run or a sweep would compute, and estimate the time."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stixel_cli.cli.options import (
    ConfigDir,
    FromFile,
    Json,
    Pictures,
    SweepOverrides,
    TrustCode,
    Workers,
    with_workers,
)
from stixel_cli.cli.terminal import counted, print_json, print_table, say

if TYPE_CHECKING:
    from stixel_cli.sweeps.design import Axis
    from stixel_cli.sweeps.graphs import SweepPlan

AS_RUN = (
    "this is what stixel run would compute, including pictures and page; "
    "a sweep draws pictures only with --pictures"
)


def plan(
    overrides: SweepOverrides = None,
    file: FromFile = None,
    workers: Workers = None,
    pictures: Pictures = False,
    trust_code: TrustCode = False,
    json: Json = False,
    config_dir: ConfigDir = None,
) -> int:
    """Print what a run or a sweep would compute.

    The table has one line per stage: all nodes, cached nodes, missing nodes and an estimate of the
    time. A node is one cached step of the computation, usually a few frames of one stage.

    If every key has one value, this is the plan of `stixel run`, with its pictures. Otherwise it
    is the plan of `stixel sweep`, which draws pictures only with --pictures.

    \b
    Examples:
      stixel plan tracker.length_scale=0.5
      stixel plan tracker.length_scale=0.2,0.4,0.8 seed=0,1,2
    """
    from stixel_cli.sweeps.graphs import planned_run, planned_sweep
    from stixel_cli.sweeps.runs import design_runs, sweep_design

    words = with_workers(overrides or [], workers)
    design = sweep_design(words, file, one_is_enough=True, trust_code=trust_code)
    runs = design_runs(design)
    if design.axes:
        planned = planned_sweep(runs, None, pictures)
    else:
        planned = replace(planned_run(runs[0].composition), notes=(AS_RUN,))
    print_plan(planned, design.axes, json)
    return 0


def print_plan(plan: "SweepPlan", axes: "Sequence[Axis]" = (), json: bool = False) -> None:
    """Print a plan as JSON or as a table."""
    content = plan_content(plan, axes)
    if json:
        print_json(content)
        return
    from stixel_cli.engine.parameters import duration

    for axis in axes:
        values = [" ".join(override.text for override in step) for step in axis.steps]
        shown = ", ".join(values[:6]) + (", …" if len(values) > 6 else "")
        say(f"{axis.name}: {counted(len(values), 'value')}: {shown}")
    for note in plan.notes:
        say(f"note: {note}")
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
    counts, seconds = content["nodes"], content["seconds"]
    estimate = "; no estimate of the time yet"
    if seconds is not None:
        workers = counted(content["workers"], "worker")
        estimate = f", about {duration(seconds)} with {workers}"
    say(
        f"{counted(content['runs'], 'run')}, {content['runs_cached']} complete; "
        f"{counted(counts['all'], 'node')}, {counts['cached']} cached, {counts['to_run']} to run"
        f"{estimate if plan.missing else ''}"
    )


def plan_content(plan: "SweepPlan", axes: "Sequence[Axis]" = ()) -> dict[str, Any]:
    """A plan in plain types."""
    configuration = plan.runs[0].composition.configuration
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
        "axes": [{"keys": list(axis.keys), "values": len(axis.steps)} for axis in axes],
        "notes": list(plan.notes),
        "stages": [
            vars(stage) | {"seconds": None if stage.seconds is None else round(stage.seconds, 2)}
            for stage in plan.stages
        ],
    }
