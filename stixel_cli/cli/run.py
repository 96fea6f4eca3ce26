"""`stixel run`: run one experiment."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from stixel_cli.cli import options
from stixel_cli.cli.stored import stored_run, tell_changed_code
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped

if TYPE_CHECKING:
    from stixel_cli.config.compose import Composition
    from stixel_cli.evaluation.scores import Scores
    from stixel_cli.results.result import RunResult
    from stixel_cli.scene.scenario import Scenario

_STYLES = {"good": "bold green", "fair": "bold yellow", "uncertainty": ""}
_STYLES |= dict.fromkeys(("poor", "lost"), "bold red")
"""Style of a verdict's sentence by the word that it begins with; of others it is yellow."""


def run(
    overrides: options.Overrides = None,
    name: options.Name = None,
    results: options.Results = Path("results"),
    workers: options.Workers = None,
    json: options.Json = False,
    verbose: options.Verbose = False,
    dry_run: options.DryRun = False,
    trust_code: options.TrustCode = False,
    config_dir: options.ConfigDir = None,
) -> int:
    """Run one experiment.

    It renders the scene, measures the road user, tracks it, scores the track and draws pictures.
    Stages whose results are in the cache are not computed again.

    With a result folder in place of overrides, it repeats the run of that folder. The new folder is
    FOLDER-rerun, and the time. Executor and cache are those of this machine, all other settings are
    those of the folder.

    `stixel describe` lists all groups with their options, `stixel describe GROUP` its keys. A
    tracker, a measurement and metrics may be your own functions, tracker=MODULE:FUNCTION.

    \b
    Examples:
      stixel run
      stixel run road_user=pedestrian path=crossing
      stixel run measurement=fabricated tracker.length_scale=0.6 seed=3
      stixel run rig=kitti stereo=bm --name kitti-bm
      stixel run path=waypoints 'path.points=[[0,12],[3,15],[0,20]]' --workers 2
      stixel run results/kitti-bm
    """
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import Progress
    from stixel_cli.experiment.run import record_run
    from stixel_cli.results.folder import check_results
    from stixel_cli.sweeps.index import update_index

    folder = options.result_folder(overrides or [])
    if folder is None:
        composition = compose(options.with_workers(overrides or [], workers))
    else:
        stored = stored_run(folder, workers, trust_code)
        tell_changed_code(stored)
        composition = stored.composition
    if dry_run:
        check_results(results, name)
        _print_plan(composition, json)
        return 0
    made = record_run(
        composition,
        results,
        name,
        progress=Progress(visible=True, advice=not json),
        on_scores=None if json else partial(print_scores, verbose),
        rerun_of=folder,
    )
    print_run(made, json, verbose)
    update_index(results)
    return 0


def _print_plan(composition: "Composition", json: bool) -> None:
    """Print the configuration, and what its run would compute."""
    import yaml

    from stixel_cli.cli.plan import plan_content, print_plan
    from stixel_cli.sweeps.graphs import planned_run

    plan = planned_run(composition)
    if json:
        print_json({"config": composition.resolved, **plan_content(plan)})
        return
    sys.stdout.write(yaml.safe_dump(composition.resolved, sort_keys=False, allow_unicode=True))
    print_plan(plan)


def print_run(made: "RunResult", json: bool, verbose: bool) -> None:
    """Print the time and the folder of a run whose scores are printed; with `json` the scores too.

    With `verbose` the names of the computed stages are printed as well.
    """
    if json:
        from stixel_cli.evaluation.verdict import verdict

        answer = {"folder": str(made.folder.absolute()), "metrics": made.metrics}
        if "correction" in made.manifest:
            answer["correction"] = made.manifest["correction"]
        print_json(answer | {"verdict": verdict(made.metrics), "stages": made.stages})
        return
    if "correction" in made.manifest:
        say_wrapped(made.manifest["correction"])
    computed = [stage["name"] for stage in made.stages if stage["status"] == "computed"]
    seconds = f"{made.manifest['seconds']:.1f} s"
    stages = ", ".join(computed) if verbose else f"{len(computed)} of {len(made.stages)} stages"
    say_wrapped(f"computed in {seconds}: {stages}" if computed else f"all cached: {seconds}")
    say(made.folder)
    sys.stdout.flush()


def print_scores(verbose: bool, _: "Scenario", scores: "Scores") -> None:
    """Print the scores of a run at once, before its pictures are drawn.

    That is the verdict and a table: of the main metrics, or of all if `verbose`.
    """
    from stixel_cli.evaluation.verdict import verdict
    from stixel_cli.report.metrics import (
        LABEL_COLUMNS,
        in_order,
        label_rows,
        main_metrics,
        score_table,
    )

    for sentence in verdict(scores.metrics):
        say_wrapped(sentence, _STYLES.get(sentence.partition(":")[0], "yellow"))
    shown = in_order(scores.metrics) if verbose else main_metrics(scores.metrics)
    say("")
    print_table(*score_table(shown))
    say("")
    labels = label_rows(scores.labels)
    if labels:
        print_table(LABEL_COLUMNS, labels, right=range(1, len(LABEL_COLUMNS)))
        say("")
    sys.stdout.flush()
