"""Scans of a radar as a table for `stixel run measurement=file`.

A car overtakes another one and measures it with a radar: a few detections on the rear and the left
side per scan, with a small error in range and a large one in bearing; every tenth scan is empty.
Replace `detections` by the detections of your own sensor.

    python examples/radar_scans.py FOLDER
    stixel run measurement=file measurement.path=FOLDER/scans.csv measurement.ego=FOLDER/ego.csv \
        tracker.seen_by=null

The second command tracks the car, whose ends so few points do not show. The first also writes
FOLDER/truth.csv; with measurement.truth=FOLDER/truth.csv the run has scores.
"""

import csv
import sys
from pathlib import Path

import numpy as np

from stixel_cli.geometry.pose import world_from_target

LENGTH, WIDTH = 4.4, 1.8  # m
SAMPLE_TIME, SCANS = 0.08, 60  # s
RANGE_STD, BEARING_STD = 0.12, np.radians(0.6)


def detections(
    sensor: np.ndarray, car: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) m and covariances (n, 2, 2) m² in the world, of a car at the pose (3,)."""
    count = random.poisson(6.0)
    rear = random.random(count) < 0.4
    along = np.where(rear, -0.5 * LENGTH, random.uniform(-0.5 * LENGTH, 0.5 * LENGTH, count))
    across = np.where(rear, random.uniform(-0.5 * WIDTH, 0.5 * WIDTH, count), 0.5 * WIDTH)
    points = world_from_target(np.stack([along, across], axis=1), car) - sensor[:2]
    ranges = np.hypot(*points.T) + RANGE_STD * random.standard_normal(count)
    bearings = np.arctan2(*points.T[::-1]) + BEARING_STD * random.standard_normal(count)
    direction = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    outer = direction[:, :, None] * direction[:, None, :]
    across_variance = (ranges * BEARING_STD)[:, None, None] ** 2
    covariances = RANGE_STD**2 * outer + across_variance * (np.eye(2) - outer)
    return sensor[:2] + ranges[:, None] * direction, covariances


def write(file: Path, columns: str, rows: list[tuple]) -> None:
    """Write a table."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns.split())
        writer.writerows(rows)


def main(folder: Path) -> None:
    """Write `scans.csv`, `ego.csv` and `truth.csv` into `folder`."""
    random = np.random.default_rng(1)
    scans, ego, truth = [], [], []
    for k in range(SCANS):
        t = round(SAMPLE_TIME * k, 6)
        sensor = np.array([0.0, 14.0 * t, 0.5 * np.pi])
        car = np.array([3.2, 14.0 + 11.0 * t, 0.5 * np.pi])
        ego.append((k, t, *sensor))
        truth.append((k, *car, LENGTH, WIDTH))
        if k % 10 == 9:
            continue
        for (x, y), ((xx, xy), (_, yy)) in zip(*detections(sensor, car, random), strict=True):
            scans.append((k, t, x, y, xx, xy, yy))
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "scans.csv", "k t x y var_xx var_xy var_yy", scans)
    write(folder / "ego.csv", "k t x y heading", ego)
    write(folder / "truth.csv", "k x y heading length width", truth)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/radar_scans.py FOLDER")
    main(Path(sys.argv[1]))
