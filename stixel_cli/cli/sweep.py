"""`stixel sweep`, `tune` and `explain`: many runs, and what --dry-run prints of them."""

import shlex
import sys
import time
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stixel_cli.border.origins import TYPED
from stixel_cli.cli import options
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped, tell
from stixel_cli.config.folders import PRESETS, of_the_machine
from stixel_cli.errors import Interrupted, UserError, counted

if TYPE_CHECKING:
    from stixel_cli.results.lineage import Lineage
    from stixel_cli.sweeps.folder import SweepResult
    from stixel_cli.sweeps.graphs import SweepPlan


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
    failing run does not stop the others, unless --fail-fast is given. The folder has a page that
    compares the options, a table with one row per run, and statistics over the seeds. The exit code
    is 1 if runs are missing at the end.

    \b
    Examples:
      stixel sweep tracker.length_scale=0.2,0.4,0.8 seed='range(0,10)'
      stixel sweep road_user='glob(*)' path=turn,s_curve measurement=fabricated
      stixel sweep --resume results/sweep-20260101-120000
    """
    from stixel_cli.results.folder import check_results, origin_of
    from stixel_cli.sweeps.design import SEED, sweep_design
    from stixel_cli.sweeps.graphs import plan_sweep
    from stixel_cli.sweeps.index import update_index
    from stixel_cli.sweeps.run import new_sweep, resumed_sweep

    started = time.perf_counter()
    words = options.with_workers(overrides or [], workers)
    if resume is not None:
        given = {"--from": file, "--name": name, "--over": over}
        given |= {"--pictures": pictures or None, "--dry-run": dry_run or None}
        for option in (option for option, value in given.items() if value is not None):
            raise UserError(f"--resume continues the sweep of that folder: leave out {option}")
        names = origin_of(resume, trust_code)
        result = resumed_sweep(resume, words, names, note=tell, fail_fast=fail_fast)
    else:
        check_results(results, name)
        plan = plan_sweep(sweep_design(words, file, trust_code, over or SEED), pictures)
        if dry_run:
            print_plan(plan, json)
            return 0
        for note in plan.notes:
            tell(note)
        result = new_sweep(plan, results, name, True, fail_fast)
    _report(result, json, time.perf_counter() - started)
    update_index(results if resume is None else resume.absolute().parent)
    return 0 if result.complete else INCOMPLETE


def _report(result: "SweepResult", json: bool, seconds: float) -> None:
    from stixel_cli.results.folder import PAGE
    from stixel_cli.sweeps.folder import SweepFolder

    done = result.count("done")
    if json:
        from stixel_cli.answers.render import records

        # Without a run there is nothing to ask.
        summary = records(result.table.answers(result.table.metrics)) if done else []
        nodes = {"computed": result.computed, "cached": result.cached}
        answer = {"folder": str(result.folder.absolute()), "complete": result.complete}
        print_json(answer | {"nodes": nodes, "runs": result.records, "summary": summary})
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
        states = Counter(run.status for run in result.runs if run.status != "done")
        counts = ", ".join(f"{number} {status}" for status, number in states.items())
        last = f"{states.total()} of {len(result.runs)} runs are not done: {counts}"
        for line in (*result.faults(_MOST_SHOWN), last):
            tell(line)
        command = SweepFolder(result.folder).resume_command(result.runs[0].overrides)
        print(command, file=sys.stderr)  # noqa: T201


def print_answers(result: "SweepResult") -> None:
    """Print the first answer, and the main metrics of the options, the best first."""
    from stixel_cli.answers.render import overview

    answers = result.table.answers()
    cells = overview(answers, intervals=1)
    for text in (answers[0].sentence, *answers[0].notes):
        say_wrapped(text)
    rows = [
        [f"{text} *" if mark else text for text, mark in zip(*both, strict=True)]
        for both in zip(cells.rows[:_MOST_SHOWN], cells.best, strict=False)
    ]
    # A narrow screen leaves out NEES and the outline's IoU first, then the last.
    columns = [*enumerate(answers, len(cells.header) - len(answers))][:0:-1]
    columns.sort(key=lambda one: one[1].question.metric not in ("nees_position_mean", "iou_mean"))
    print_table(cells.header, rows, cells.numbers, leave_out=[i for i, _ in columns])
    if (more := len(cells.rows) - _MOST_SHOWN) > 0:
        say(f"{counted(more, 'more option')}: summary.md")
    if any(True in marks for marks in cells.best):
        say("*: shown to be the best")


def tune(
    overrides: options.SweepOverrides = None,
    objective: options.option(str, "A metric, or A,B for a Pareto front.", "METRICS") = "iou_mean",
    trials: options.option(int, "Number of trials.", min=1, max=10_000) = 40,
    seeds: options.option(
        int, "Seeds from 1000 to tune on, and from 0 to report.", min=1, max=1000
    ) = 10,
    over: options.Over = None,
    name: options.Name = None,
    results: options.Results = Path("results"),
    workers: options.Workers = None,
    resume: options.Resume = None,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Search for the best values of settings with Optuna.

    Parameters have several values, KEY='interval(A,B)', or KEY='tag(log,interval(A,B))'. A trial
    is averaged over seeds from 1000, and stops if it is clearly worse after the first four. The
    gain over the default is that on seeds from 0, in pairs. An objective that should be 1, such as
    nees_position_mean, counts by its |log|. The folder has a page, a table of the trials, and a
    preset: stixel run --config-dir FOLDER/preset experiment=tuned.

    Example: stixel tune measurement=fabricated tracker.sigma_q='tag(log,interval(0.1,10))'
    """
    from stixel_cli.answers.render import records
    from stixel_cli.config.overrides import read_overrides
    from stixel_cli.results.folder import check_results, new_folder, origin_of, write_whole_folder
    from stixel_cli.results.result import yaml_text
    from stixel_cli.sweeps import tuning as tunings
    from stixel_cli.sweeps.run import resumed_overrides

    words = options.with_workers(overrides or [], workers)
    if resume is not None:
        if over or name:
            raise UserError("--resume continues the tuning of that folder: leave out the rest")
        request = tunings.read_request(resume)
        origin = origin_of(resume, trust_code)
        (given,) = resumed_overrides([request.overrides], words, origin)
    else:
        check_results(results, name)
        swept = (over or "seed").split(",")
        request = tunings.TuneRequest(list(words), objective.split(","), swept, seeds, trials)
        given = read_overrides(words, TYPED)
    tuning, files = tunings.Tuning(given, request), {tunings.REQUEST: yaml_text(vars(request))}
    folder = resume or new_folder(
        results, name, "tune", datetime.now(UTC), lambda path: write_whole_folder(path, files)
    )
    machine = [word for word in words if of_the_machine(word)]
    command = shlex.join(["stixel", "tune", "--resume", str(folder), *machine, *PRESETS.option])
    try:
        tuning.search(request.trials)
        best, gain = tunings.write_outcome(folder, tuning, command)
    except Interrupted:
        raise Interrupted(f"interrupted; resume with: {command}") from None
    if json:
        answer = {"trial": best.name, "settings": best.settings, "gain": records(gain)}
        print_json({"folder": str(folder.absolute()), **answer})
    else:
        for one in gain:
            say_wrapped(f"{tunings.label(one.question.metric)}. {one.sentence}")
        chosen = " ".join(f"{key}={value}" for key, value in best.settings.items())
        say(f"trial {best.name}: {chosen}", folder)
    return 0


def print_plan(plan: "SweepPlan", json: bool = False, config: dict[str, Any] | None = None) -> None:
    """Print a plan, of one run after its `config`, as JSON or as a table."""
    content = plan_content(plan)
    if json:
        print_json(content if config is None else {"config": config, **content})
        return
    if config is not None:
        import yaml

        sys.stdout.write(yaml.safe_dump(config, sort_keys=False, allow_unicode=True))
    from stixel_cli.engine.parameters import duration

    for axis in plan.design.axes:
        values = [" ".join(override.text for override in step) for step in axis.steps]
        shown = ", ".join(values[:6]) + (", …" if len(values) > 6 else "")
        say(f"{axis.name}: {counted(len(values), 'value')}: {shown}")
    for note in plan.notes:
        say(f"note: {note}")
    rows = []
    for stage in plan.stages:
        name, nodes, cached, to_run, seconds = stage.values()
        time = "?" if seconds is None else duration(seconds)
        rows.append((name, str(nodes), str(cached), str(to_run), time if to_run else ""))
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
    from stixel_cli.results.result import listed

    text = f", about {duration(seconds)} with {counted(workers, 'worker')}"
    return f"{text}; never measured: {listed(unmeasured)}" if unmeasured else text


def plan_content(plan: "SweepPlan") -> dict[str, Any]:
    """A plan in plain types."""
    from stixel_cli.sweeps.graphs import estimated

    seconds, unmeasured = estimated([plan])
    return {
        "runs": len(plan.runs),
        "runs_cached": sum({*plan.missing}.isdisjoint(run.targets) for run in plan.runs),
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
        "stages": plan.stages,
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
        answer = []
        for one in missing:
            why = [vars(change) | {"text": str(change)} for change in one.changes]
            answer.append({"key": one.key, "stage": one.stage, "node": one.label, "why": why})
        print_json(answer)
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
    from stixel_cli.experiment.stored import has_pictures, read_stored_run
    from stixel_cli.results.lineage import read_lineage
    from stixel_cli.results.result import SWEEP_FILE
    from stixel_cli.sweeps.design import design_runs, sweep_design
    from stixel_cli.sweeps.folder import SweepFolder
    from stixel_cli.sweeps.graphs import plan_runs, plan_sweep, planned_run
    from stixel_cli.sweeps.run import stored_runs

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
