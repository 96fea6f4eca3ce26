"""A run, planned, computed or read: from the run to its folder, and from any folder to runs.

Files may come from anybody, so each is checked.
"""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import yaml

from stixel_cli.border.files import read_arrays, read_bytes, read_json, read_yaml
from stixel_cli.errors import UserError, printable_path
from stixel_cli.evaluation.scores import SERIES, Scores

if TYPE_CHECKING:
    from stixel_cli.engine.graph import Graph
    from stixel_cli.geometry.rig_calibration import RigCalibration
    from stixel_cli.measurements.scans import Scans
    from stixel_cli.recordings.types import LabelTruth
    from stixel_cli.results.lineage import Lineage
    from stixel_cli.results.pictures import CameraFrames
    from stixel_cli.scene.scenario import Scenario
    from stixel_cli.stixels.types import Objects, Stixels
    from stixel_cli.tracking.track import ObjectTrack, Track


DONE, FAILED, SKIPPED, MISSING = "done", "failed", "skipped", "missing"
"""Status of a run; `skipped`: a node failed in another run; `missing`: not run yet."""

GROUPS = ("road_user", "path", "measurement", "tracker")
"""The groups of a configuration by which runs are told apart."""


MANIFEST = "manifest.json"
"""The file that marks the folder of a run."""

SWEEP_FILE = "sweep.yaml"
"""The file that marks the folder of a sweep."""

DEEPEST = 4
"""Depth of the search below the folder."""


def check_folder(path: Path) -> None:
    """Raise UserError unless `path` is the result folder of a run."""
    if not path.exists():
        raise UserError(f"{printable_path(path)}: no such folder")
    if not path.is_dir():
        raise UserError(f"{path}: not a folder; give the result folder of a run")
    if (path / SWEEP_FILE).exists():
        run = path / "runs" / "0000"
        raise UserError(
            f"{path}: a sweep's folder; give the folder of one of its runs, such as {run}"
        )
    if not (path / MANIFEST).exists():
        raise UserError(
            f"{printable_path(path)}: not the result folder of a run ({MANIFEST} is missing)"
        )


def read_metrics(folder: Path) -> dict[str, float | int | None]:
    """Metrics of a folder, None for one without a value; UserError if the file is not valid."""
    file = folder / "metrics.json"
    metrics = read_json(file)
    for name, value in metrics.items():
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise UserError(f"{file}: {name[:60]} must be a number or null")
    return metrics


def read_config(folder: Path) -> dict[str, Any]:
    """Content of a folder's `config.yaml`, not validated; UserError if it is no configuration."""
    file = folder / "config.yaml"
    content = read_yaml(file)
    if not all(isinstance(key, str) for key in content):
        raise UserError(f"{file}: must contain the groups of a configuration")
    return content


def flat_settings(content: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """Dotted key to value as text, in the order of `content`, as `read_config` gives it."""
    settings: dict[str, str] = {}
    for name, value in content.items():
        key = f"{prefix}{name}"
        match value:
            case dict():
                settings |= flat_settings(value, f"{key}.")
            case None | bool():
                settings[key] = json.dumps(value)
            case float() if value.is_integer():
                settings[key] = str(int(value))  # 3 and 3.0 are the same setting
            case list():
                settings[key] = f"[{', '.join(map(str, value))}]"
            case _:
                settings[key] = str(value)
    return settings


def read_series(file: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The times (K,), s, of a file of scores, and the `SERIES` that it has, each (K,).

    UserError if it is missing or not valid, or the shapes of its arrays differ.
    """
    arrays = read_arrays(file)
    if "t" not in arrays:
        raise UserError(f"{file}: the times (t) are missing")
    found = {name: arrays[name].astype(np.float64) for name in SERIES if name in arrays}
    times = arrays["t"].astype(np.float64)
    if times.ndim != 1:
        raise UserError(f"{file}: t has shape {times.shape}, must have one dimension")
    for name, values in found.items():
        if values.shape != times.shape:
            raise UserError(f"{file}: {name} has shape {values.shape}, t has {times.shape}")
    return times, found


def read_png(file: Path) -> bytes:
    """The content of a picture; UserError if it is not a PNG image."""
    data = read_bytes(file)
    if not data.startswith(b"\x89PNG\r\n\x1a\n"):
        raise UserError(f"{file}: not a PNG image")
    return data


def find_folders(root: Path) -> list[Path]:
    """The folders of runs and sweeps below `root`, without the runs of sweeps.

    UserError if the folder does not exist or cannot be read.
    """
    if not root.is_dir():
        raise UserError(f"{printable_path(root)}: no such folder")
    if not os.access(root, os.R_OK | os.X_OK):
        raise UserError(f"{root}: not a readable folder")
    found = []
    for place, folders, files in os.walk(root):
        depth, inside = len(Path(place).relative_to(root).parts), {*folders, *files}
        is_result = MANIFEST in inside or (SWEEP_FILE in inside and depth > 0)
        found += [Path(place)] * is_result
        # A name that begins with a dot is unfinished or of another program.
        further = [name for name in sorted(folders) if not name.startswith(".")]
        folders[:] = further if depth < DEEPEST and not is_result else []
    return found


_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def json_text(value: Any) -> str:
    """JSON with two spaces of indent and a newline at its end; NaN is refused."""
    return json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def yaml_text(content: Any) -> str:
    """YAML in the order of the keys."""
    return yaml.dump(content, Dumper=_DUMPER, sort_keys=False, allow_unicode=True)


def listed(parts: Sequence[object]) -> str:
    """a, b and c."""
    texts = [str(part) for part in parts]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


@dataclass(frozen=True)
class RunResult:
    """One run: to be computed, computed in this process, or read from a result folder.

    A run that was computed alone has everything. One that was read has what its reader names:
    `read_run`, `read_scored_run`, `list_runs`, `results.tables.with_arrays` or
    `experiment.stored.read_stored_run`. One of a sweep has `composition`, `graph`, `targets`,
    `metrics`, `status` and `failure`, and the entries `run`, `overrides`, `choices`, `seed` and
    `swept` of its manifest; one of a sweep's folder has the seed as typed, and no graph.

    Attributes:
        settings: the configuration in plain types, as in `config.yaml`.
        manifest: content of `manifest.json`.
        metrics: name to value, None for a metric without a value; as in `metrics.json`.
        folder: the result folder; None if nothing was written.
        composition: the validated experiment, see `stixel_cli.compose`.
        scenario, scans, track, scores: results of the stages of these names.
        pictures: path below `figures/` to the file's bytes.
        camera: chunks of the camera's frames, in order; empty for a run without images.
        stixels, objects: chunks of the stixels and of their clusters, in order; empty unless images
            are recorded.
        tracks: those of moving objects, with `source.target=auto`, which has no `track`.
        truths: those of all labels of the recording, with `source.target=auto`.
        calibration: what is known of the disparity error of a recording's rig.
        lineage: keys, settings and versions of each stage; None in a folder of an older version.
        label: name of the run in a legend; in a sweep `key=value …`.
        status: `done`, `failed`, `skipped` or `missing`.
        failure: of a run that failed or was skipped: why; of a listed one: why it is not readable.
        graph: of this run only; in a sweep, from `graphs.plan_runs` on.
        targets: in a sweep, keys of the nodes whose results it requires, the scores first.
        variant: in a study, name of the sweep's variant; "" if it has none.
        load: in a study, returns the result of a stage that the sweep's `results` names, or the
            list of the results of its chunks. It reads the store at each call.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    manifest: Mapping[str, Any] = field(default_factory=dict)
    metrics: Mapping[str, float | int | None] = field(default_factory=dict)
    folder: Path | None = None
    composition: Any = None
    scenario: "Scenario | None" = None
    scans: "Scans | None" = None
    track: "Track | None" = None
    scores: Scores | None = None
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    camera: "tuple[CameraFrames, ...]" = ()
    stixels: "tuple[Stixels, ...]" = ()
    objects: "tuple[Objects, ...]" = ()
    tracks: "tuple[ObjectTrack, ...]" = ()
    truths: "tuple[LabelTruth, ...]" = ()
    calibration: "RigCalibration | None" = None
    lineage: "Lineage | None" = None
    label: str = ""
    status: str = DONE
    failure: Exception | None = None
    graph: "Graph | None" = None
    targets: tuple[str, ...] = ()
    variant: str = ""
    load: Callable[[str], Any] | None = None
    plot: ClassVar[Callable[..., Any]]
    """Draws the run from above, `plot(ax=None)`: `stixel_cli.plot`, which sets it."""

    def __repr__(self) -> str:
        """The choices, the seed, the first sentence of the verdict and the folder, in one line."""
        from stixel_cli.evaluation.verdict import verdict

        words = [self.choice(group) for group in GROUPS if group in self.settings]
        words.append(f"seed {self.settings.get('seed')}")
        return f"<RunResult {' '.join(words)}: {verdict(self.metrics)[0]} {self.folder or ''}>"

    @property
    def configuration(self) -> Any:
        """Its validated configuration."""
        return self.composition.configuration

    @property
    def index(self) -> int:
        """Its number in its sweep, from 0."""
        return self.manifest["run"]

    @property
    def seed(self) -> int | None:
        """Its seed; None if unknown."""
        seed = self.manifest.get("seed")
        return seed if isinstance(seed, int) else None

    @property
    def is_sweep(self) -> bool:
        """Whether this entry of `list_runs` is a sweep."""
        return self.failure is None and not (self.folder / MANIFEST).exists()

    @property
    def setting(self) -> dict[str, str]:
        """Keys that differ between the runs of its sweep, without the seed, to values as typed."""
        return {str(key): str(value) for key, value in self.entry("swept").items()}

    @property
    def choices(self) -> dict[str, str]:
        """The option of each group."""
        return {str(group): str(option) for group, option in self.entry("choices").items()}

    def entry(self, name: str) -> dict[str, Any]:
        """A mapping in the manifest; empty if it is missing, or anything else."""
        found = self.manifest.get(name)
        return found if isinstance(found, dict) else {}

    @property
    def overrides(self) -> tuple[str, ...]:
        """The overrides as typed."""
        given = self.manifest.get("overrides")
        return tuple(map(str, given)) if isinstance(given, list) else ()

    @property
    def stages(self) -> list[dict[str, Any]]:
        """One record per stage: name, key, status ("computed" or "cached"), seconds, nodes,
        nodes_computed."""
        return self.manifest["stages"]

    @property
    def record(self) -> dict[str, Any]:
        """One row of a table of runs: folder, seed, overridden settings, metrics.

        `pandas.DataFrame([result.record for result in results])` is that table.
        """
        given = {name: self.composition.value(name) for name in self.composition.keys}
        folder = None if self.folder is None else str(self.folder)
        return {"folder": folder, "seed": self.configuration.seed, **given, **self.metrics}

    @property
    def tables(self) -> dict[str, dict[str, np.ndarray]]:
        """Columns of `scans` (one row per point); `track`, `scores`, `ego`, `truth` (per scan).

        `smoothed` has those of the smoothed track, if there is one.
        `ego` has the poses of the ego car, `truth` those of the target; a run without truth has no
        `truth`. `stixels` (in the ego frame) and `objects` have one row per stixel and object of a
        recording, `tracks` one per road user and scan, `labels` one per label of their class. All
        others are in the world frame. They are the columns of the CSV files.

        `pandas.DataFrame(result.tables["track"])` is such a table.
        """
        from stixel_cli.results import tables

        scenario, scores = self.scenario, self.scores
        times, ego_poses = scenario.times, scenario.ego_poses_world
        found = {
            "scans": tables.scan_columns(self.scans),
            "scores": tables.score_columns(scores),
            "ego": tables.pose_columns(times, ego_poses),
        }
        if self.track is not None:
            found["track"] = tables.track_columns(self.track)
            if self.track.smoothed is not None:
                found["smoothed"] = tables.track_columns(self.track.smoothed)
        if scenario.known.any():
            found["truth"] = tables.truth_columns(scenario)
        if self.objects:
            found["stixels"] = tables.stixel_columns(self.stixels)
            found["objects"] = tables.object_columns(self.objects, times, ego_poses)
        if self.tracks:
            found["tracks"] = tables.tracks_columns(self.tracks)
        if scores.labels:
            # One row per label; columns as in `LabelScore`.
            rows = [vars(label) for label in scores.labels]
            found["labels"] = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return found

    @property
    def arrays(self) -> dict[str, dict[str, np.ndarray]]:
        """The arrays of the NPZ files: the `tables`, but of track and truth everything."""
        from stixel_cli.results.tables import track_arrays, truth_arrays

        found = self.tables
        if self.track is not None:
            found["track"] = track_arrays(self.track)
        if "smoothed" in found:
            found["smoothed"] = track_arrays(self.track.smoothed)
        return found | ({"truth": truth_arrays(self.scenario)} if "truth" in found else {})

    @property
    def ego_tables(self) -> dict[str, dict[str, np.ndarray]]:
        """The columns of `scans` and `track` in the ego car's frame at each time index.

        `ego` has the car's own pose in the world: k, t (s), x, y (m), heading (rad).
        """
        from stixel_cli.results.tables import scans_in_ego_frame, track_in_ego_frame

        ego, poses = self.tables["ego"], self.scenario.ego_poses_world
        found = {"ego": ego, "scans": scans_in_ego_frame(self.scans, poses)}
        if self.track is not None:
            found["track"] = track_in_ego_frame(self.track, poses)
        return found

    def numbered(self, index: int) -> "RunResult":
        """The same with another number in its sweep."""
        return replace(self, manifest={**self.manifest, "run": index})

    def choice(self, group: str) -> str:
        """The chosen option of a group, or its `kind` if the option is not known."""
        if group in self.choices:
            return self.choices[group]
        value = self.settings[group]
        return str(value.get("kind", "own") if isinstance(value, dict) else value)


def read_run(folder: Path) -> RunResult:
    """Read settings, manifest and metrics of a result folder; nothing else of the result is set.

    UserError if it is not a result folder, or a file is missing or not valid.
    """
    check_folder(folder)
    return RunResult(
        folder=folder,
        manifest=read_json(folder / MANIFEST),
        settings=read_config(folder),
        metrics=read_metrics(folder),
    )


def read_scored_run(folder: Path) -> RunResult:
    """Read a result folder as `read_run` does, with the scores.

    Errors over time that the folder lacks are NaN.
    """
    run = read_run(folder)
    times, series = read_series(folder / "scores.npz")
    missing = {name: np.full(times.shape, np.nan) for name in SERIES if name not in series}
    scores = Scores(times=times, **series, **missing, metrics=run.metrics)
    return replace(run, scores=scores)


def list_runs(root: Path) -> list[RunResult]:
    """The runs and sweeps below `root`, oldest first, with manifest and metrics.

    A sweep is one entry without its runs: only the time in its manifest is set. So is `failure` of
    a run that is not readable. UserError if the folder does not exist or cannot be read.
    """
    runs = map(listed_run, find_folders(root))
    return sorted(runs, key=lambda run: (str(run.manifest.get("created", "")), run.folder))


def listed_run(folder: Path) -> RunResult:
    """One entry of `list_runs`."""
    run = RunResult(folder=folder)
    try:
        if os.path.lexists(folder / MANIFEST):
            return replace(run, manifest=read_json(folder / MANIFEST), metrics=read_metrics(folder))
        modified = datetime.fromtimestamp((folder / SWEEP_FILE).stat().st_mtime, UTC)
        return replace(run, manifest={"created": modified.isoformat(timespec="seconds")})
    except UserError as fault:
        return replace(run, failure=fault)
    except OSError:
        return replace(run, manifest={"created": ""})
