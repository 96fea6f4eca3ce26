"""One experiment from its configuration to its result folder, and back; stored runs on one page."""

import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.border import Origin
from stixel_cli.config.compose import Composition, compose, from_resolved
from stixel_cli.config.folders import OF_THE_MACHINE, PRESETS
from stixel_cli.config.overrides import admit_code, check_parameters, functions_of
from stixel_cli.config.schema import Configuration
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import Store
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.evaluation.scores import Scores
from stixel_cli.experiment.run_names import differences, joined_name
from stixel_cli.experiment.stages import RESULTS, compared_rows, computed_stages, experiment_graph
from stixel_cli.experiment.table import PICTURES
from stixel_cli.report.playback import playback_html
from stixel_cli.results.folder import check_results, new_folder, origin_of, write_folder
from stixel_cli.results.lineage import differing_settings, lineage_of, provenance, read_lineage
from stixel_cli.results.result import RunResult, listed, read_run
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.file import FileTrackParameters, track_doubts
from stixel_cli.version import __version__

CAMERA = "camera_frames"
"""The stage that prepares the camera's images for the playback page."""

OBJECTS, TRACKS = "objects", "tracks"
"""Stages of a recording: objects in its frames, and tracks of those that move."""


def run_experiment(
    composition: Composition,
    progress: Progress | None = None,
    pictures: bool = True,
    camera: bool | None = None,
    on_scores: Callable[[Scenario, Scores], None] | None = None,
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
        if progress is not None and progress.advice:
            for doubt in filter(None, _doubts(composition.configuration, results)):
                progress.note(doubt)
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


def _doubts(configuration: Configuration, results: Mapping[str, Any]) -> Iterator[str | None]:
    """What is probably wrong with the user's files, one line each; `results` are of `RESULTS`."""
    scenario, tracker = results["scenario"], configuration.tracker
    measurement, user = configuration.measurement, configuration.road_user
    if isinstance(tracker, FileTrackParameters):
        scans, track = results["scans"], results["track"]
        yield from track_doubts(tracker, scans, track, scenario.target_poses_world)
    if measurement.kind == "file":
        # Shapely is imported for it.
        from stixel_cli.measurements.file_truth import heading_note

        yield heading_note(scenario, measurement.angle_unit)
    elif user.mesh is not None and configuration.source.kind == "rendered":
        # So is trimesh.
        from stixel_cli.scene.mesh_file import mesh_doubt

        yield mesh_doubt(user.mesh, user.mesh_scale, user.mesh_up)


def record_run(
    composition: Composition,
    results: Path | None,
    name: str | None,
    progress: Progress,
    on_scores: Callable[[Scenario, Scores], None] | None = None,
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


def trust_stored_run(run: RunResult, trusted: bool) -> list[str]:
    """Refuse a stored run of user-defined code, unless `trusted`, or of wrong parameters.

    What this user ran here is trusted while neither the folder nor the code has changed. Returns
    the names of `_changed_code`.
    """
    origin = origin_of(run.folder, trusted)
    if not origin.source and _changed_code(run):
        origin = Origin(str(run.folder), trusted)
    admit_code(run.settings, (), origin)
    if functions_of(run.settings):
        check_parameters(run.composition.configuration)
    return _changed_code(run)


def _changed_code(stored: RunResult) -> list[str]:
    """The user's modules, and files that they declare, that differ from those of a stored run."""
    before = None if stored.lineage is None else stored.lineage.code
    if before is None or not functions_of(stored.settings):
        return []
    graph = experiment_graph(stored.composition)
    codes = [nodes[0].identity.code for name in graph.stages if (nodes := graph.of_stage(name))]
    now = {name: digest for code in codes for name, digest in code.modules_of_user.items()}
    return [name for name in sorted(now) if before.get(name) != now[name]]


def read_stored_run(path: Path, overrides: tuple[str, ...] = ()) -> RunResult:
    """Read the result folder `path`, with its validated experiment and its lineage.

    The experiment has the executor and the cache of this machine. `overrides` may only change the
    groups `OF_THE_MACHINE`. UserError if it is not a result folder, or its configuration is not
    valid in this version.
    """
    run = read_run(path)
    own = compose(overrides).resolved
    resolved = {**run.settings, **{name: own[name] for name in OF_THE_MACHINE if name in own}}
    try:
        configuration = from_resolved(resolved)
    except ConfigurationError as fault:
        theirs = run.entry("versions").get("stixel")
        other = f" (the folder was made by stixel {theirs}, this is {__version__})"
        hint = "" if theirs in (None, __version__) else other
        raise UserError(f"{path / 'config.yaml'}: {fault}{hint}") from None
    composition = Composition(configuration, run.choices, run.overrides, resolved)
    return replace(run, settings=resolved, composition=composition, lineage=read_lineage(path))


def has_pictures(run: RunResult) -> bool:
    """Whether the folder of a run has pictures. Runs of a sweep have them only on request."""
    return (run.folder / "figures").is_dir()


SCENE = ("road_user", "path", "ego")
"""The groups that define the scene; with scans from a file, those files do."""

OF_SCENE = ("times", "ego_poses_world", "target_poses_world", "contours_target", "limb_poses")
"""What runs of one scene share of their ground truth."""


def folders_page(
    stored: Sequence[RunResult], labels: Sequence[str], progress: Progress
) -> tuple[str, list[str]]:
    """The page of stored runs of one scene, whose folders have the `labels`; notes for the user.

    Results that the cache lacks are computed; the page shows the new results. Where they differ
    from those of a folder, the page and the notes say so. UserError if the runs are not of one
    scene; and the errors of `computed_stages`.
    """
    check_one_scene(stored, labels)
    trackers = [one.choice("tracker") for one in stored]
    distinct = len(stored) > 1 and len(set(trackers)) == len(trackers)
    runs = []
    for one, name in zip(stored, trackers if distinct else labels, strict=True):
        run = run_experiment(one.composition, progress, pictures=False, camera=True)
        runs.append(replace(run, label=name, manifest=one.manifest, folder=one.folder))
    for label, run in zip(labels, runs, strict=True):
        pairs = [(getattr(runs[0].scenario, n), getattr(run.scenario, n)) for n in OF_SCENE]
        if not all(np.array_equal(*pair, equal_nan=True) for pair in pairs):
            raise UserError(
                f"the runs must share one scene: the paths in {labels[0]} and {label} differ, "
                "though their settings do not"
            )
    notes = [
        f"{label}: this version gives different results, which the page shows "
        f"(stixel verify {one.folder} explains why)"
        for label, one, run in zip(labels, stored, runs, strict=True)
        if run.metrics != one.metrics
    ]
    several = f"{listed([run.label for run in runs])} on one scene"
    title, names = (labels[0], ()) if len(runs) == 1 else (several, labels)
    return playback_html(runs, title, notes, names), notes


def check_one_scene(stored: Sequence[RunResult], labels: Sequence[str]) -> None:
    """Raise UserError with the first setting that differs, unless all runs share the scene."""
    scenes = []
    for one in stored:
        groups = ("measurement",) if one.settings["measurement"].get("kind") == "file" else SCENE
        scenes.append(RunResult(settings={group: one.settings[group] for group in groups}))
    for key, values in differing_settings(scenes).items():
        there = next(i for i, value in enumerate(values) if value != values[0])
        raise UserError(
            f"the runs must share one scene: {key} is {values[0]} in {labels[0]} and "
            f"{values[there]} in {labels[there]}"
        )
