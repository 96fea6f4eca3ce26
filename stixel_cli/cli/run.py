"""`stixel run`: one experiment, from overrides to a result folder."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from stixel_cli.cli.terminal import print_table
from stixel_cli.config.compose import Composition, compose
from stixel_cli.engine.progress import make_progress
from stixel_cli.engine.store import Store, open_store
from stixel_cli.experiment.run import one_line_errors, plan_experiment, record_run
from stixel_cli.results.folder import check_name
from stixel_cli.results.result import RunResult
from stixel_cli.results.text import json_text


def run_command(
    overrides: Sequence[str],
    name: str | None,
    results: Path,
    workers: int | None,
    json: bool,
    dry_run: bool,
) -> int:
    """Run one experiment, print its scores and the folder's path; the exit code.

    Raises:
        UserError: for whatever the user can put right, before anything is written.
    """
    composition = compose(with_workers(overrides, workers))
    if dry_run:
        check_name(results, name)
        return _print_plan(composition, open_store(composition.configuration.cache), json)
    command = ["stixel", "run", *composition.overrides]
    made = record_run(composition, command, results, name, progress=make_progress())
    print_run(made, json)
    return 0


def with_workers(overrides: Sequence[str], workers: int | None) -> list[str]:
    """`overrides`, and `--workers` as the override that it stands for."""
    return [*overrides, *([] if workers is None else [f"executor.workers={workers}"])]


def print_run(made: RunResult, json: bool) -> None:
    """Print scores and folder of a run, as JSON or for the eye."""
    if json:
        answer = {"folder": str(made.folder.absolute()), "metrics": made.metrics}
        sys.stdout.write(json_text(answer | {"stages": made.stages}))
    else:
        _print_scores(made)


def _print_scores(made: RunResult) -> None:
    from rich.console import Console

    from stixel_cli.report.table import scores_table

    console = Console(highlight=False, soft_wrap=True)
    console.print(scores_table(made.metrics))
    if not made.scenario.star_convex:
        console.print(
            "The true contour is not star-convex about its centre: no track can match it exactly."
        )
    if made.metrics["empty_scans"] == made.metrics["scans"]:
        console.print("The road user was never measured: every scan is empty.")
    computed = [stage["name"] for stage in made.stages if stage["status"] == "computed"]
    stages = ", ".join(computed) or "nothing, all was cached"
    console.print(f"computed: {stages}; {made.manifest['seconds']:.1f} s")
    console.print(str(made.folder), markup=False)


def _print_plan(composition: Composition, store: Store, json: bool) -> int:
    """Print the configuration and, by stage, how many nodes there are and how many would run."""
    with one_line_errors():
        planned = plan_experiment(composition.configuration, store)
    missing = set(planned.missing)
    stages: list[dict[str, Any]] = []
    for name in planned.graph.stage_names:
        # A pipeline has steps that only studies ask for.
        nodes = planned.needed.intersection(planned.graph.stages[name])
        if nodes:
            to_run = len(missing.intersection(nodes))
            stages.append({"name": name, "nodes": len(nodes), "to_run": to_run})
    if json:
        sys.stdout.write(json_text({"config": composition.resolved, "stages": stages}))
        return 0
    sys.stdout.write(yaml.safe_dump(composition.resolved, sort_keys=False, allow_unicode=True))
    rows = [tuple(str(value) for value in stage.values()) for stage in stages]
    print_table(("stage", "nodes", "to run"), rows, right=(1, 2))
    return 0
