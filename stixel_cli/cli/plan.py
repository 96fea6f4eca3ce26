"""`stixel explain`, and what --dry-run prints: what would be computed, how long, and why."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from stixel_cli.border import TYPED
from stixel_cli.cli import options
from stixel_cli.cli.terminal import print_json, print_table, say
from stixel_cli.errors import UserError, counted

if TYPE_CHECKING:
    from stixel_cli.results.lineage import Lineage
    from stixel_cli.sweeps.graphs import SweepPlan


def print_plan(plan: "SweepPlan", json: bool = False) -> None:
    """Print a plan as JSON or as a table."""
    content = plan_content(plan)
    if json:
        print_json(content)
        return
    from stixel_cli.engine.parameters import duration

    for axis in plan.design.axes:
        values = [" ".join(override.text for override in step) for step in axis.steps]
        shown = ", ".join(values[:6]) + (", …" if len(values) > 6 else "")
        say(f"{axis.name}: {counted(len(values), 'value')}: {shown}")
    for note in plan.notes:
        say(f"note: {note}")
    rows = []
    for stage in plan.stages:
        time = "?" if stage.seconds is None else duration(stage.seconds)
        counts = map(str, (stage.nodes, stage.cached, stage.to_run))
        rows.append((stage.name, *counts, time if stage.to_run else ""))
    print_table(("stage", "nodes", "cached", "to run", "time"), rows, right=(1, 2, 3, 4))
    counts, seconds = content["nodes"], content["seconds"]
    estimate = estimate_text(seconds, content["workers"], content["unmeasured"])
    say(
        f"{counted(content['runs'], 'run')}, {content['runs_cached']} complete; "
        f"{counted(counts['all'], 'node')}, {counts['cached']} cached, {counts['to_run']} to run"
        f"{estimate if plan.missing else ''}"
    )


def estimate_text(seconds: float | None, workers: int, unmeasured: Sequence[str]) -> str:
    """`, about 3 min with 2 workers; never measured: track`."""
    if seconds is None:
        return "; no estimate of the time yet"
    from stixel_cli.engine.parameters import duration
    from stixel_cli.results.reader import listed

    text = f", about {duration(seconds)} with {counted(workers, 'worker')}"
    return f"{text}; never measured: {listed(unmeasured)}" if unmeasured else text


def plan_content(plan: "SweepPlan") -> dict[str, Any]:
    """A plan in plain types."""
    from stixel_cli.sweeps.graphs import estimated

    seconds, unmeasured = estimated([plan])
    return {
        "runs": len(plan.runs),
        "runs_cached": plan.complete_runs(),
        "nodes": {
            "all": len(plan.needed),
            "cached": len(plan.needed) - len(plan.missing),
            "to_run": len(plan.missing),
        },
        "seconds": None if seconds is None else round(seconds, 1),
        "unmeasured": unmeasured,
        "workers": plan.executor.workers,
        "axes": [{"keys": list(axis.keys), "values": len(axis.steps)} for axis in plan.design.axes],
        "notes": list(plan.notes),
        "stages": [
            vars(stage) | {"seconds": None if stage.seconds is None else round(stage.seconds, 2)}
            for stage in plan.stages
        ],
    }


def explain(
    what: options.argument(
        list[str] | None,
        "A result folder, or overrides.",
        "FOLDER|OVERRIDES",
        options.complete_run_or_override,
    ) = None,
    file: options.FromFile = None,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Explain why results would be recomputed.

    For each missing node, the reason is one of: new, setting, function, version, evicted, input.
    The nodes of a sweep (several values, a file, or a sweep's folder) are listed once. Pictures are
    included for one run, and for the folder of a sweep that has them.

    \b
    Examples:
      stixel explain tracker.length_scale=0.5
      stixel explain tracker.length_scale=0.5,0.6 seed=0,1
      stixel explain results/contour
    """
    from stixel_cli.engine.explain import by_stage
    from stixel_cli.engine.explain import explain as explain_nodes

    plan, lineages = _asked(what or [], file, trust_code)
    keys, code = set(), {}
    for lineage in filter(None, lineages):
        keys |= {key for stage in lineage.stages.values() for key in stage.keys}
        code |= lineage.code or {}
    missing = explain_nodes(plan.graph, plan.store, plan.targets, (keys, code))
    if json:
        print_json(
            [
                {"key": one.key, "stage": one.stage, "node": one.label}
                | {"why": [vars(change) | {"text": str(change)} for change in one.changes]}
                for one in missing
            ]
        )
        return 0
    for group, text in by_stage(missing):
        first, last = group[0].label, group[-1].label
        labels = first if first == last else f"{first} … {last}"
        labels += f", {len(group)} nodes" if len(group) > 1 else ""
        say(f"{labels}: {text}")
    if not missing:
        current = keys <= plan.graph.nodes.keys()
        other = "" if current else "; the folder has results of other code or files"
        say(f"nothing to recompute: all results are cached{other}")
    return 0


def _asked(
    what: Sequence[str], file: str | None, trust_code: bool
) -> "tuple[SweepPlan, Sequence[Lineage | None]]":
    """The plan of the nodes to explain; the lineages of the runs in the folder to compare with."""
    from stixel_cli.config.compose import Composer
    from stixel_cli.experiment.run import has_pictures, read_stored_run
    from stixel_cli.results.lineage import read_lineage
    from stixel_cli.results.reader import SWEEP_FILE
    from stixel_cli.sweeps.folder import SweepFolder
    from stixel_cli.sweeps.graphs import plan_runs, plan_sweep, planned_run
    from stixel_cli.sweeps.runs import design_runs, sweep_design
    from stixel_cli.sweeps.whole import stored_runs

    folder = options.result_folder(what)
    if folder and file is not None:
        raise UserError(f"{folder}: name either a result folder or --from FILE")
    if folder and (folder / SWEEP_FILE).exists():
        request = SweepFolder(folder).request()
        runs = stored_runs(request, (), TYPED, imports=False)
        plan = plan_runs(runs, request.pictures, request.nodes)
        return plan, [read_lineage(run) for run in folder.glob("runs/*")]
    if folder:
        stored = read_stored_run(folder)
        return planned_run(stored.composition, has_pictures(stored)), [stored.lineage]
    design = sweep_design(what, file, trust_code, one_is_enough=True)
    if design.axes:
        return plan_sweep(design), ()
    return planned_run(design_runs(design, Composer())[0].composition), ()
