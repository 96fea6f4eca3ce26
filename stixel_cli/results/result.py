"""The result of one run, as it flows from the run to its folder, to tables, plots and pages."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.evaluation.label_types import LabelScore, LabelScores
from stixel_cli.evaluation.metric_table import Scores
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.measurements.scans import Scans
from stixel_cli.results.ego_frame import (
    pose_columns,
    scans_in_ego_frame,
    track_in_ego_frame,
)
from stixel_cli.results.lineage import Lineage
from stixel_cli.results.objects import object_columns
from stixel_cli.results.pictures import CameraFrames
from stixel_cli.results.reader import (
    SERIES,
    check_folder,
    read_config,
    read_manifest,
    read_metrics,
    read_pictures,
    read_series,
)
from stixel_cli.scene.scenario import Scenario
from stixel_cli.stixels.objects import Objects
from stixel_cli.tracking.found import ObjectTrack
from stixel_cli.tracking.track import Track


@dataclass(frozen=True)
class RunResult:
    """The result of one run, computed in this process or read from a result folder.

    A result that was computed has everything. A result that was read has what its reader names:
    `read_run`, `read_scored_run` or `experiment.run.read_stored_run`.

    Attributes:
        settings: the configuration in plain types, as in `config.yaml`.
        manifest: content of `manifest.json`.
        metrics: name to value, None for a metric without a value; as in `metrics.json`.
        folder: the result folder; None if nothing was written.
        composition: the validated experiment, see `stixel_cli.compose`.
        scenario, scans, track, scores: results of the stages of these names.
        pictures: path below `figures/` to the file's bytes.
        camera: chunks of the camera's frames, in order; empty for a run without images.
        objects: chunks of the clusters of stixels, in order; empty unless images are recorded.
        tracks: those of all that moves, with `source.target=auto`.
        lineage: keys, settings and versions of each stage; None in a folder of an older version.
        label: name of the run in a legend.
    """

    settings: Mapping[str, Any]
    manifest: Mapping[str, Any]
    metrics: dict[str, float | int | None]
    folder: Path | None = None
    composition: Any = None
    scenario: Scenario | None = None
    scans: Scans | None = None
    track: Track | None = None
    scores: Scores | None = None
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    camera: tuple[CameraFrames, ...] = ()
    objects: tuple[Objects, ...] = ()
    tracks: tuple[ObjectTrack, ...] = ()
    lineage: Lineage | None = None
    label: str = ""

    def __repr__(self) -> str:
        """The choices, the seed, the verdict and the folder, in one line."""
        groups = ("road_user", "path", "measurement", "tracker")
        words = [self.choice(group) for group in groups if group in self.settings]
        words.append(f"seed {self.settings.get('seed')}")
        return (
            f"<RunResult {' '.join(words)}: {' '.join(verdict(self.metrics))} {self.folder or ''}>"
        )

    def _repr_html_(self) -> str:
        """What a notebook shows: verdict, main metrics, and the picture from above."""
        # The only import of a module above this one: notebooks look for the method here.
        from stixel_cli.report.notebook import result_html

        return result_html(self)

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
        typed = [text.lstrip("+").partition("=")[0] for text in self.composition.overrides]
        given = {name: self.composition.value(name) for name in typed}
        folder = None if self.folder is None else str(self.folder)
        seed = self.composition.configuration.seed
        return {"folder": folder, "seed": seed, **given, **self.metrics}

    @property
    def tables(self) -> dict[str, dict[str, np.ndarray]]:
        """Columns of `scans` (one row per point); `track`, `scores`, `ego`, `truth` (per scan).

        `ego` has the poses of the ego car, `truth` those of the target; a run without truth has no
        `truth`. `objects` has one row per object of a recording, `tracks` one per
        road user and scan, `labels` one per label of their class. All are in the world frame.
        They are the columns of the CSV files.

        `pandas.DataFrame(result.tables["track"])` is such a table.
        """
        scenario = self.scenario
        return {
            "scans": scan_columns(self.scans),
            "track": track_columns(self.track),
            "scores": score_columns(self.scores),
            "ego": pose_columns(scenario.times, scenario.ego_poses_world),
            **({"truth": truth_columns(scenario)} if scenario.known.any() else {}),
            **(
                {"objects": object_columns(self.objects, scenario.times, scenario.ego_poses_world)}
                if self.objects
                else {}
            ),
            **({"tracks": tracks_columns(self.tracks)} if self.tracks else {}),
            **(
                {"labels": label_columns(self.scores.labels)}
                if self.scores.labels and self.scores.labels.labels
                else {}
            ),
        }

    @property
    def ego_tables(self) -> dict[str, dict[str, np.ndarray]]:
        """The columns of `scans` and `track` in the ego car's frame at each time index.

        `results.ego_frame.read_ego_tables` gives the same from a result folder.
        """
        tables = self.tables
        return {
            "scans": scans_in_ego_frame(tables["scans"], tables["ego"]),
            "track": track_in_ego_frame(track_arrays(self.track), tables["ego"]),
        }

    def choice(self, group: str) -> str:
        """The chosen option of a group, or its `kind` if the option is not known."""
        choices = self.manifest.get("choices")
        if isinstance(choices, dict) and group in choices:
            return str(choices[group])
        value = self.settings[group]
        return str(value.get("kind", "own") if isinstance(value, dict) else value)


def read_run(folder: Path) -> RunResult:
    """Read settings, manifest and metrics of a result folder; nothing else of the result is set.

    Raises:
        UserError: if it is not a result folder, or a file is missing or not valid.
    """
    check_folder(folder)
    return RunResult(
        folder=folder,
        manifest=read_manifest(folder),
        settings=read_config(folder),
        metrics=read_metrics(folder),
    )


def read_scored_run(folder: Path) -> RunResult:
    """Read a result folder as `read_run` does, with the scores and the picture of the path.

    Errors over time that the folder lacks are NaN.

    Raises:
        UserError: if it is not a result folder, or a file is missing or not valid.
    """
    check_folder(folder)
    times, series = read_series(folder / "scores.npz")
    run = read_run(folder)
    missing = {name: np.full(times.shape, np.nan) for name in SERIES if name not in series}
    scores = Scores(times=times, **series, **missing, metrics=run.metrics)
    return replace(run, scores=scores, pictures=read_pictures(folder / "figures", "path.png"))


def scan_columns(scans: Scans) -> dict[str, np.ndarray]:
    """The scans as a table, one row per point: k, t (s), x, y (m), variances (m²)."""
    k = np.repeat(np.arange(len(scans)), np.diff(scans.offsets))
    return {
        "k": k,
        "t": scans.times[k],
        "x": scans.points_world[:, 0],
        "y": scans.points_world[:, 1],
        "var_xx": scans.covariances_world[:, 0, 0],
        "var_xy": scans.covariances_world[:, 0, 1],
        "var_yy": scans.covariances_world[:, 1, 1],
    }


def track_columns(track: Track) -> dict[str, np.ndarray]:
    """The track as a table, one row per scan: pose, rates, their stds, number of points used."""
    names = ("x", "y", "heading", "x_rate", "y_rate", "heading_rate")
    std = np.sqrt(np.diagonal(track.covariances, axis1=1, axis2=2)[:, :6])
    return {
        "k": np.arange(len(track.times)),
        "t": track.times,
        **{name: track.means[:, i] for i, name in enumerate(names)},
        **{f"std_{name}": std[:, i] for i, name in enumerate(names)},
        "points_used": np.diff(track.used_offsets),
        "nis": track.nis,
        "nis_degrees_of_freedom": track.nis_degrees_of_freedom,
        **class_columns(track),
    }


def tracks_columns(tracks: Sequence[ObjectTrack]) -> dict[str, np.ndarray]:
    """The tracks as one table: `track`, its number from 0, and the columns of `track_columns`.

    k is that of the run.
    """
    tables = [track_columns(one.track) for one in tracks]
    for one, table in zip(tracks, tables, strict=True):
        table["k"] = table["k"] + one.first
    # A track of the prior's class has no probabilities.
    names = dict.fromkeys(name for table in tables for name in table)
    numbers = np.repeat(np.arange(len(tracks)), [len(table["k"]) for table in tables])
    return {"track": numbers} | {
        name: np.concatenate(
            [table.get(name, np.full(len(table["k"]), np.nan)) for table in tables]
        )
        for name in names
    }


def label_columns(labels: LabelScores) -> dict[str, np.ndarray]:
    """The fields of `LabelScore` as a table, one row per label."""
    return {
        one.name: np.array([getattr(row, one.name) for row in labels.labels])
        for one in fields(LabelScore)
    }


def score_columns(scores: Scores) -> dict[str, np.ndarray]:
    """The errors as a table, one row per scan; units as in `Scores`.

    Without any truth only the NIS.
    """
    with_truth = ("centre_error", "orientation_error", "iou", "iou_box", "nees_position")
    known = np.isfinite(scores.iou_box).any()
    return {
        "k": np.arange(len(scores.times)),
        "t": scores.times,
        **({name: getattr(scores, name) for name in with_truth} if known else {}),
        "nis": scores.nis,
    }


def truth_columns(scenario: Scenario) -> dict[str, np.ndarray]:
    """The truth as a table, one row per scan with a known pose: the pose, its rates, and the size.

    length and width, m, are those of the box along and across the heading.
    """
    k = np.flatnonzero(scenario.known)
    x_rate, y_rate, heading_rate = scenario.target_rates_world[k].T
    length, width = np.ptp(scenario.box_target, axis=0)
    return {
        **pose_columns(scenario.times[k], scenario.target_poses_world[k]),
        "k": k,
        "x_rate": x_rate,
        "y_rate": y_rate,
        "heading_rate": heading_rate,
        "length": np.full(len(k), length),
        "width": np.full(len(k), width),
    }


def truth_arrays(scenario: Scenario) -> dict[str, np.ndarray]:
    """The columns of the truth, and the target's `contour` (L, M, 2) m in its own frame.

    L is the number of poses of the limbs; the column limb_pose has that of each row. Where only the
    box is known there is no contour.
    """
    columns = truth_columns(scenario)
    if scenario.only_box:
        return columns
    limb_poses = scenario.limb_poses[columns["k"]]
    return columns | {"limb_pose": limb_poses, "contour": scenario.contours_target}


def track_arrays(track: Track) -> dict[str, np.ndarray]:
    """All arrays of the track by name; shapes as in `Track`. A class has an array of its own."""
    arrays = {name: value for name, value in vars(track).items() if isinstance(value, np.ndarray)}
    return arrays | class_columns(track)


def class_columns(track: Track) -> dict[str, np.ndarray]:
    """The probability of each class, (K,); empty for a track without them."""
    return {f"{name}_probability": p for name, p in (track.class_probabilities or {}).items()}
