"""One experiment from its configuration to its result folder."""

import shlex
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from stixel_cli.config.compose import Composition
from stixel_cli.config.folders import PRESETS
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.run_names import differences, joined_name
from stixel_cli.experiment.stages import RESULTS, compared_rows, computed_stages
from stixel_cli.experiment.table import PICTURES
from stixel_cli.report.playback import playback_html
from stixel_cli.results.folder import check_results, new_folder, write_folder
from stixel_cli.results.lineage import lineage_of, provenance
from stixel_cli.results.result import RunResult
from stixel_cli.tracking.file import FileTrackParameters
from stixel_cli.validation.track_doubts import track_doubts

CAMERA = "camera_frames"
"""The stage that prepares the camera's images for the playback page."""

OBJECTS, TRACKS = "objects", "tracks"
"""Stages of a recording: objects in its frames, and tracks of those that move."""


def run_experiment(
    composition: Composition,
    progress: Progress | None = None,
    pictures: bool = True,
    camera: bool | None = None,
    on_scores: Callable[[Scores], None] | None = None,
    store: Store | None = None,
) -> RunResult:
    """Compute the missing nodes of an experiment and load its result.

    With `pictures` they are drawn; with `camera` the camera's frames are loaded for the page, as
    with pictures if it is None. The errors and the other arguments are those of `computed_stages`.
    """
    wanted = [*RESULTS, *(PICTURES if pictures else ()), OBJECTS, TRACKS, "calibration"]
    wanted += ["stixels"] if composition.configuration.source.kind != "rendered" else []
    wanted += [CAMERA] if (pictures if camera is None else camera) else []
    with computed_stages(composition, wanted, progress, on_scores, store) as (done, load):
        results = {name: next(iter(load(name)), None) for name in (*RESULTS, "calibration")}
        drawn = [one.files for name in PICTURES for one in load(name)]
        objects = tuple(load(OBJECTS))
        return RunResult(
            settings=composition.resolved,
            manifest={"choices": composition.choices, "stages": done.stage_records()},
            metrics=dict(results["scores"].metrics),
            composition=composition,
            **results,
            pictures={path: data for files in drawn for path, data in files.items()},
            camera=tuple(load(CAMERA)),
            stixels=tuple(load("stixels")) if objects else (),
            objects=objects,
            tracks=next(iter(load(TRACKS)), ()),
            truths=next(iter(load("label_truths")), ()),
            lineage=lineage_of(done.graph, done.status, done.store, {}),
        )


def _doubts(run: RunResult) -> Iterator[str | None]:
    """What is probably wrong with the user's files, one line each."""
    configuration, truth = run.configuration, run.scenario.target_poses_world
    tracker, user = configuration.tracker, configuration.road_user
    if isinstance(tracker, FileTrackParameters):
        yield from track_doubts(tracker, run.scans, run.track, truth)
    if configuration.measurement.kind == "file":
        # Shapely is imported for it.
        from stixel_cli.measurements.file_truth import heading_note

        yield heading_note(run.scenario, configuration.measurement.angle_unit)
    elif user.mesh is not None and configuration.source.kind == "rendered":
        # So is trimesh.
        from stixel_cli.scene.mesh_file import mesh_doubt

        yield mesh_doubt(user.mesh, user.mesh_scale, user.mesh_up)


def record_run(
    composition: Composition,
    results: Path | None,
    name: str | None,
    progress: Progress,
    on_scores: Callable[[Scores], None] | None = None,
    rerun_of: Path | None = None,
) -> RunResult:
    """Run an experiment and write its result folder into `results`, if that is given.

    Its `name` is by default made of what differs from the default, see `experiment.run_names`, or
    of the name of the repeated folder, `rerun_of`, and of the time. The other arguments are those
    of `computed_stages`; after its errors no result folder is left.
    """
    started = time.perf_counter()
    if results is not None:
        check_results(results, name)
    now = datetime.now(UTC)
    rows = compared_rows(composition, progress.note)
    run = run_experiment(composition, progress, on_scores=on_scores)
    for doubt in filter(None, _doubts(run) if progress.advice else ()):
        progress.note(doubt)
    if rerun_of is None:
        command = ["stixel", "run", *composition.overrides, *PRESETS.option]
        stem = joined_name(differences(composition.choices, composition.overrides))
    else:
        command = ["stixel", "run", str(rerun_of)]
        stem = f"{rerun_of.resolve().name.lstrip('.')[:100]}-rerun"
    rig = run.calibration
    manifest = {
        "command": shlex.join(command),
        "overrides": list(composition.overrides),
        "choices": composition.choices,
        "seed": composition.configuration.seed,
        "created": now.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - started, 3),
        "workers": composition.configuration.executor.workers,
        **provenance(),
        **({} if rerun_of is None else {"rerun_of": str(rerun_of)}),
        **({"correction": rig.text, **rig.values} if rig and rig.rig.states_error else {}),
        **({} if rows is None else {"row_difference_px": round(rows.difference, 2)}),
        **({} if run.scans.epoch is None else {"time_offset_ns": run.scans.epoch}),
        "star_convex": run.scenario.star_convex,
        "stages": run.stages,
    }
    run = replace(run, manifest=manifest)
    if results is None:
        return run

    def write(folder: Path) -> None:
        write_folder(folder, run, playback_html([replace(run, label=folder.name)], folder.name))

    # Only now: a refused cache or scheduler leaves no folder behind.
    return replace(run, folder=new_folder(results, name, stem, now, write))
