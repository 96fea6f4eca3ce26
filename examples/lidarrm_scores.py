"""Scores of three trackers next to the published ones of their authors, on the same scans.

The scenario is that of S. Steuernagel, K. Thormann, M. Baum 2024, *Random matrix-based tracking of
rectangular extended objects with contour measurements*, FUSION. DIR has a folder for each run, such
as `default-00`, with the tables scans.csv and truth.csv, and `rows.json`: run to tracker to the IoU
of its box at each scan. The score is the mean over all scans of all runs.

    python examples/lidarrm_scores.py DIR

It prints a table. "First scan": the start is the first scan alone, as that of the authors; the
motion noise is that of the scenario, and there is no gate. "Four scans": start and sizes are those
of `experiment=lidarrm`; a run in which no start is found has an IoU of 0, and the cell has their
number. `gm_mem_ekf` uses the points of a scan in a random order, as its authors do: its scores are
means over `ORDERS`, with the least and the greatest.
"""

import json
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.evaluation.contour_errors import areas, overlaps
from stixel_cli.geometry.pose import rectangle, world_from_target
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import read_truth
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.baselines.lidar_random_matrix import measured_centre
from stixel_cli.tracking.prior import PriorShape
from stixel_cli.tracking.several import start_from_scans
from stixel_cli.tracking.track import InitialState

TRACKERS = {
    "lidar_random_matrix": "LidarRM",
    "li_random_matrix": "LiImproved",
    "gm_mem_ekf": "GM-MEM-EKF*",
}
"""Each tracker with its name in `rows.json`."""

SETTINGS = ["tracker.sigma_q=0.43", "tracker.gate_probability=null"]

ORDERS = range(4)


def settings_of(tracker: str) -> Any:
    """The configuration of `experiment=lidarrm` with this `tracker`."""
    files = ["measurement.path=scans.csv", "measurement.truth=truth.csv"]
    chosen = ["experiment=lidarrm", f"tracker={tracker}", *SETTINGS, *files]
    return compose(chosen).configuration


def ious(folder: Path, settings: Any, first_scan: bool, order: int) -> tuple[np.ndarray, bool]:
    """IoU (K,) of the box at each scan of the run in `folder`, and whether it has a start.

    Without a start, the IoU is 0. `order` chooses the order of the points of a scan, of which
    `gm_mem_ekf` alone takes notice.
    """
    scans = read_scans(str(folder / "scans.csv"), None, settings.measurement.range_std)
    truth = read_truth(scans, str(folder / "truth.csv"))
    scans, prior, states = shuffled(scans, order), settings.prior, []
    if first_scan:
        initial, prior = authors_start(scans, prior, settings.tracker.kind)
        states = [np.array([*initial.mean, prior.length, prior.width])]
        scans = without_first(scans)
    else:
        try:
            initial = start_from_scans(scans, settings.start, prior)
        except ValueError:
            return np.zeros(len(scans)), False
    module = import_module(type(settings.tracker).__module__)
    track = module.track(scans, initial, prior, settings.tracker)
    estimated = [
        world_from_target(rectangle(*state[6:8]), state[:3]) for state in [*states, *track.means]
    ]
    true = [world_from_target(truth.contours_target[0], pose) for pose in truth.target_poses_world]
    return overlaps(areas(np.array(estimated)), areas(np.array(true))), True


def authors_start(scans: Scans, prior: PriorShape, kind: str) -> tuple[InitialState, PriorShape]:
    """Initial state, and a prior with its size, from the first scan, without a velocity."""
    points = scans.points_world[scans.rows(0)]
    centre, factor, least = points.mean(axis=0), 3.0, 1.0
    if kind == "lidar_random_matrix":
        centre, factor, least = measured_centre(points, np.zeros(2), "ends"), 4.0 / 3.0, 1e-6
    scatter = factor * (points - centre).T @ (points - centre) / len(points)
    squares, axes = np.linalg.eigh(scatter)
    width, length = 2.0 * np.maximum(np.sqrt(np.maximum(squares, 0.0)), least)
    heading = np.arctan2(axes[1, 1], axes[0, 1])
    sizes = {"length": length, "width": width}
    # The variance of each half size is .5 m².
    sizes |= {f"{name}_std": np.sqrt(2.0) / size for name, size in sizes.items()}
    state = InitialState(
        np.array([*centre, heading, 0.0, 0.0, 0.0]), np.diag([0.1, 0.1, 0.1, 10.0, 10.0, 0.1])
    )
    return state, replace(prior, **sizes)


def shuffled(scans: Scans, order: int) -> Scans:
    """The scans with the points of each in another order; `order` 0 keeps it."""
    if order == 0:
        return scans
    random = np.random.default_rng(order)
    rows = [scans.rows(k) for k in range(len(scans))]
    indices = np.concatenate([random.permutation(np.arange(r.start, r.stop)) for r in rows])
    return replace(
        scans,
        points_world=scans.points_world[indices],
        covariances_world=scans.covariances_world[indices],
    )


def without_first(scans: Scans) -> Scans:
    """The scans from the second on."""
    count = scans.offsets[1]
    return Scans(
        scans.times[1:],
        scans.sensor_poses_world[1:],
        scans.offsets[1:] - count,
        scans.points_world[count:],
        scans.covariances_world[count:],
    )


def score(runs: list[Path], settings: Any, first_scan: bool, order: int) -> tuple[float, int]:
    """Mean IoU over all scans of all `runs`, and the number of runs without a start."""
    parts = [ious(folder, settings, first_scan, order) for folder in runs]
    mean = float(np.concatenate([values for values, _ in parts]).mean())
    return mean, sum(not started for _, started in parts)


def main(folder: Path) -> None:
    """Print the table."""
    rows = json.loads((folder / "rows.json").read_text(encoding="utf-8"))
    print("| scans | tracker | published | first scan | four scans |")
    print("|---|---|---|---|---|")
    for scans in ("default", "sparse"):
        runs = sorted(one.parent for one in folder.glob(f"{scans}-*/scans.csv"))
        for tracker, name in TRACKERS.items():
            published = np.concatenate([rows[run.name][name] for run in runs]).mean()
            settings, cells = settings_of(tracker), []
            for first_scan in (True, False):
                orders = ORDERS if tracker == "gm_mem_ekf" else ORDERS[:1]
                found = [score(runs, settings, first_scan, order) for order in orders]
                values = [one[0] for one in found]
                cell = f"{np.mean(values):.3f}"
                if found[0][1]:
                    cell += f" ({found[0][1]} of {len(runs)} not started)"
                if len(values) > 1:
                    cell += f" ({min(values):.3f}–{max(values):.3f})"
                cells.append(cell)
            print(f"| {scans} | `{tracker}`, {name} | {published:.3f} | {' | '.join(cells)} |")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
