"""A stored run with its scenario, scans and track, from the NPZ files of its folder."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.files import read_arrays
from stixel_cli.measurements.scans import Scans
from stixel_cli.results.result import RunResult, read_png, read_scored_run
from stixel_cli.results.tables import Table
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import STATE, Track


def with_arrays(run: RunResult) -> RunResult:
    """A run that was read, with what `read_scored_run` adds, the picture of the path, `scenario`,
    `scans` and `track`.

    The poses of the sensor are those of the ego car. Folders do not store `Scenario.scored`.
    UserError if a file is missing or not valid; folders of older versions have no `ego.npz`.
    """
    scored, picture = read_scored_run(run.folder), run.folder / "figures/path.png"
    with _reading(run.folder / "ego.npz") as ego:
        scenario = _scenario(ego, {})
    if (run.folder / "truth.npz").exists():
        with _reading(run.folder / "truth.npz") as truth:
            scenario = _scenario(ego, truth)
    with _reading(run.folder / "scans.npz") as table:
        scans = _scans(ego, table)
    smoothed = None
    if (run.folder / "smoothed.npz").exists():
        with _reading(run.folder / "smoothed.npz") as table:
            smoothed = _track(table)
    with _reading(run.folder / "track.npz") as table:
        track = replace(_track(table), smoothed=smoothed)
    return replace(
        run,
        scores=scored.scores,
        pictures={picture.name: read_png(picture)} if picture.exists() else {},
        scenario=scenario,
        scans=scans,
        track=track,
    )


@contextmanager
def _reading(file: Path) -> Iterator[Table]:
    """Context with the arrays of a file; UserError, which names it, if they are not of a run."""
    try:
        yield read_arrays(file)
    except KeyError as missing:
        raise UserError(f"{file}: has no array {missing}") from None
    except (IndexError, TypeError, ValueError) as fault:
        raise UserError(f"{file}: not of a run: {fault}") from None


def _track(arrays: Table) -> Track:
    ending = "_probability"
    classes = {n.removesuffix(ending): p for n, p in arrays.items() if n.endswith(ending)}
    own = {f.name: arrays[f.name] for f in fields(Track) if f.name in arrays}
    return Track(**own, class_probabilities=classes or None)


def _scans(ego: Table, scans: Table) -> Scans:
    offsets = np.searchsorted(scans["k"], np.arange(len(ego["t"]) + 1))
    variances = _columns(scans, ("var_xx", "var_xy", "var_xy", "var_yy")).reshape(-1, 2, 2)
    return Scans(ego["t"], _columns(ego), offsets, _columns(scans, ("x", "y")), variances)


def _scenario(ego: Table, truth: Table) -> Scenario:
    """The scenario; without truth its poses are NaN. Where only the box is known, it is centred."""
    poses, rates = np.full((2, len(ego["t"]), 3), np.nan)
    contours, limb_poses = np.zeros((1, 0, 2)), np.zeros(len(ego["t"]), np.int64)
    if truth:
        k = truth["k"].astype(np.int64)
        poses[k], rates[k] = _columns(truth), _columns(truth, STATE[3:])
        half = 0.5 * _columns(truth, ("length", "width"))[0]
        box = half * np.array([[[-1, -1], [1, -1], [1, 1], [-1, 1]]])
        contours, limb_poses[k] = truth.get("contour", box), truth.get("limb_pose", 0)
    only_box = "contour" not in truth
    return Scenario(ego["t"], _columns(ego), poses, rates, contours, limb_poses, only_box)


def _columns(table: Table, names: tuple[str, ...] = STATE[:3]) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=1)
