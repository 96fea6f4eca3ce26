"""`stixel run`: one experiment, from overrides to a result folder."""

import shlex
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml

from stixel_cli.config.compose import Composition, compose
from stixel_cli.engine.errors import CacheError, CodeChanged, StageFailure
from stixel_cli.engine.progress import make_progress
from stixel_cli.engine.store import Store, default_cache_folder
from stixel_cli.errors import UserError
from stixel_cli.experiment.folder import json_text, reserve_folder, write_folder
from stixel_cli.experiment.provenance import git_state, machine, package_versions
from stixel_cli.experiment.run import Outcome, plan_experiment, run_experiment


def run_command(
    overrides: Sequence[str],
    name: str | None,
    results: Path,
    workers: int,
    json: bool,
    dry_run: bool,
) -> int:
    """Run one experiment, print its scores and the folder's path; the exit code.

    Raises:
        UserError: for whatever the user can put right, before anything is written.
    """
    started = time.perf_counter()
    composition = compose(overrides)
    store = Store(default_cache_folder())
    if dry_run:
        return _print_plan(composition, store, json)
    now = datetime.now(UTC)
    folder = reserve_folder(results, name, f"{_choice_name(composition)}-{now:%Y%m%d-%H%M%S}")
    outcome = _run(composition, store, workers)
    manifest = {
        "command": shlex.join(["stixel", "run", *overrides]),
        "overrides": list(overrides),
        "choices": composition.choices,
        "seed": composition.configuration.seed,
        "created": now.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - started, 3),
        "workers": workers,
        "git": git_state(),
        "versions": package_versions(),
        "machine": machine(),
        "star_convex": outcome.scenario.star_convex,
        "stages": outcome.stages,
    }
    write_folder(folder, outcome, composition.resolved, manifest)
    if json:
        answer = {"folder": str(folder), "metrics": outcome.scores.metrics}
        sys.stdout.write(json_text(answer | {"stages": outcome.stages}))
    else:
        _print_outcome(folder, outcome, manifest["seconds"])
    return 0


def _run(composition: Composition, store: Store, workers: int) -> Outcome:
    try:
        return run_experiment(
            composition.configuration, store, workers=workers, progress=make_progress()
        )
    except (CacheError, CodeChanged) as error:
        raise UserError(str(error)) from error
    except StageFailure as failure:
        # What a stage says of its input or of the machine is for the user; the rest is a defect.
        if isinstance(failure.cause, ValueError | UserError) or hasattr(failure.cause, "one_line"):
            raise UserError(f"{failure.label}: {failure.cause}") from failure
        raise


def _choice_name(composition: Composition) -> str:
    groups = ("road_user", "path", "measurement", "tracker")
    return "-".join(composition.choices[group] for group in groups)


def _print_outcome(folder: Path, outcome: Outcome, seconds: float) -> None:
    from rich.console import Console

    from stixel_cli.report.table import scores_table

    console = Console(highlight=False, soft_wrap=True)
    console.print(scores_table(outcome.scores.metrics))
    if not outcome.scenario.star_convex:
        console.print(
            "The true contour is not star-convex about its centre: no track can match it exactly."
        )
    computed = [stage["name"] for stage in outcome.stages if stage["status"] == "computed"]
    console.print(f"computed: {', '.join(computed) or 'nothing, all was cached'}; {seconds:.1f} s")
    console.print(str(folder), markup=False)


def _print_plan(composition: Composition, store: Store, json: bool) -> int:
    """Print the configuration and, by stage, how many nodes there are and how many would run."""
    try:
        planned = plan_experiment(composition.configuration, store)
    except CacheError as error:
        raise UserError(str(error)) from error
    missing = set(planned.missing)
    stages: list[dict[str, Any]] = []
    for name in planned.graph.stage_names:
        nodes = [node.id for node in planned.graph.of_stage(name)]
        stages.append(
            {"name": name, "nodes": len(nodes), "to_run": sum(node in missing for node in nodes)}
        )
    if json:
        sys.stdout.write(json_text({"config": composition.resolved, "stages": stages}))
        return 0
    from rich import box
    from rich.console import Console
    from rich.table import Table

    sys.stdout.write(yaml.safe_dump(composition.resolved, sort_keys=False, allow_unicode=True))
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.add_column("stage")
    table.add_column("nodes", justify="right")
    table.add_column("to run", justify="right")
    for stage in stages:
        table.add_row(*(str(value) for value in stage.values()))
    Console(highlight=False).print(table)
    return 0
