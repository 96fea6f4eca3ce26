"""`stixel run`, `verify` and `export`: one run, also a stored one, repeated or in other formats."""

import shlex
import sys
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from stixel_cli.cli import options
from stixel_cli.cli.sweep import print_plan
from stixel_cli.cli.terminal import print_json, print_table, say, say_wrapped, tell
from stixel_cli.errors import Interrupted

if TYPE_CHECKING:
    from stixel_cli.evaluation.scores import Scores
    from stixel_cli.experiment.stored import Verification
    from stixel_cli.results.result import RunResult


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
    from stixel_cli.sweeps.index import update_index

    folder = options.result_folder(overrides or [])
    if folder is None:
        composition = compose(options.with_workers(overrides or [], workers))
    else:
        composition = stored_run(folder, workers, trust_code).composition
    if dry_run:
        from stixel_cli.results.folder import check_results
        from stixel_cli.sweeps.graphs import planned_run

        check_results(results, name)
        print_plan(planned_run(composition), json, composition.resolved)
        return 0
    progress = Progress(visible=True, advice=not json)
    on_scores = None if json else partial(print_scores, verbose)
    made = record_run(composition, results, name, progress, on_scores, folder)
    print_run(made, json, verbose)
    update_index(results)
    return 0


def print_run(made: "RunResult", json: bool, verbose: bool) -> None:
    """Print a run's time, stages (their names if `verbose`) and folder; with `json` its scores."""
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


def print_scores(verbose: bool, scores: "Scores") -> None:
    """Print the scores of a run at once, before its pictures are drawn.

    That is the verdict and a table: of the main metrics, or of all if `verbose`.
    """
    from stixel_cli.evaluation.verdict import verdict
    from stixel_cli.report import metrics

    shown = metrics.in_order(scores.metrics) if verbose else metrics.main_metrics(scores.metrics)
    # A reader that ends, as `head` does, ends no run: from then on Rich writes to the null device.
    with suppress(SystemExit):
        for sentence in verdict(scores.metrics):
            say_wrapped(sentence, _STYLES.get(sentence.partition(":")[0], "yellow"))
        say("")
        print_table(*metrics.score_table(shown))
        say("")
        if labels := metrics.label_rows(scores.labels):
            print_table(metrics.LABEL_COLUMNS, labels, right=range(1, len(metrics.LABEL_COLUMNS)))
            say("")
        sys.stdout.flush()


def stored_run(folder: Path, workers: int | None, trust_code: bool) -> "RunResult":
    """The run of a result folder, to be computed with the executor and cache of this machine.

    Each of the user's modules that differs from its copy in the folder is named on stderr.
    UserError if the folder cannot be read, or names user-defined code that is not trusted.
    """
    from stixel_cli.experiment.stored import read_stored_run, trust_stored_run
    from stixel_cli.results.lineage import CODE_FOLDER

    stored = read_stored_run(folder, tuple(options.with_workers((), workers)))
    for name in trust_stored_run(stored, trust_code):
        tell(f"{name}: is not as in {stored.folder / CODE_FOLDER}: today's is used")
    return stored


def verify(
    folder: options.Folder,
    cached: options.flag("--cached", "Take unchanged results from the cache.") = False,
    workers: options.Workers = None,
    trust_code: options.TrustCode = False,
    json: options.Json = False,
) -> int:
    """Repeat a run and check that the results are identical.

    All stages are computed again, outside the cache. If results differ, the command reports the
    first stage that differs, by how much, and which version or function changed. The exit code is
    0 if all results are identical, otherwise 1.

    Example: stixel verify results/contour
    """
    import tempfile

    from stixel_cli.border.origins import written
    from stixel_cli.engine.progress import Progress
    from stixel_cli.engine.store import Store, open_store
    from stixel_cli.experiment.stored import verify_run
    from stixel_cli.results.lineage import provenance

    stored = stored_run(folder, workers, trust_code)
    store = open_store(stored.composition.configuration.cache)
    progress = Progress(visible=True)
    if cached:
        verification = verify_run(stored, store, store, provenance(), progress)
    else:
        with written(Path("the temporary folder")):
            temporary = tempfile.TemporaryDirectory(prefix="stixel-verify-")
        try:
            with temporary as scratch:
                verification = verify_run(stored, Store(scratch), store, provenance(), progress)
        except KeyboardInterrupt:
            discarded = "interrupted; the results are discarded (--cached keeps them)"
            raise Interrupted(discarded) from None
    if json:
        answer = {"folder": str(folder), "identical": verification.identical}
        print_json(answer | asdict(verification))
    else:
        say(*_as_text(verification, stored.lineage is None))
    return 0 if verification.identical else 1


def _as_text(verification: "Verification", no_record: bool) -> list[str]:
    computed = sum(stage["nodes_computed"] for stage in verification.stages)
    nodes = sum(stage["nodes"] for stage in verification.stages)
    again = f"{computed} of {nodes} nodes computed again"
    compared = verification.files_compared
    if verification.identical:
        lines = [f"identical: {compared} files compared, {again}"]
    else:
        lines = [f"differs: {len(verification.files)} of {compared} files, {again}"]
        lines += [f"  {file.file}: {file.what}" for file in verification.files]
    first = {"key": verification.first_by_key, "result": verification.first_by_value}
    for kind, stage in first.items():
        if stage is not None:
            lines.append(f"first stage with another {kind}: {stage.stage}: {stage.what}")
            lines += [f"  {cause}" for cause in stage.causes]
    if no_record:
        lines.append("the keys of the stages are unknown: lineage.json is missing")
    if verification.changes:
        lines.append("since then:")
        lines += [f"  {change}" for change in verification.changes]
    return lines


def export(
    folder: options.Folder,
    format: options.choice(
        "kitti|csv|tum|stx1|rerun|mlflow",
        "kitti: images, calibration, labels, poses, disparity as a clip of KITTI's "
        "tracking benchmark. csv: scans, track, truth, contours, and their columns. tum: "
        "trajectories, as evo reads them. stx1: stixels for pyStixel-lib. rerun: run.rrd. "
        "mlflow: settings, scores, pages, of a sweep too.",
        "--format",
    ),
    output: options.NewFolder = None,
    workers: options.Workers = None,
    trust_code: options.TrustCode = False,
) -> int:
    """Write a run, or with mlflow a sweep, in the format of other tools.

    Missing results are computed, but for mlflow.

    \b
    Examples:
      stixel export results/contour --format kitti --output clip
      stixel export results/contour --format csv
      stixel export results/my_sweep --format mlflow
    """
    from stixel_cli.engine.progress import Progress
    from stixel_cli.export.export import export as write
    from stixel_cli.export.mlflow_folder import export_mlflow

    target = options.new_file(output or Path(f"{folder.resolve().name}-{format}"))
    if format == "mlflow":
        export_mlflow(folder.resolve(), target.absolute())
    else:
        stored = stored_run(folder, workers, trust_code)
        answer = write(stored, target.absolute(), format, Progress(visible=True))
    say(target)
    if format == "kitti":
        say(shlex.join(["stixel", "run", *answer]))
    return 0
