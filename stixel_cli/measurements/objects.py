"""Objects of each frame: stixels that are near each other in depth and bearing."""

import numpy as np

from stixel_cli.measurements.clusters import cluster
from stixel_cli.measurements.parameters import Gates
from stixel_cli.stixels.types import Objects, Stixels


def find_objects(stixels: Stixels, gates: Gates, frames: range) -> Objects:
    """The clusters of the stixels of `frames` inside the gates of height and range.

    `stixels` contains exactly `frames`. HDBSCAN, which needs no radius, is compared in
    `bench/bench_objects.py`.
    """
    inside = stixels.inside(gates)
    of_stixels = np.full(len(inside), -1, dtype=np.int32)
    offsets, boxes, corners, counts = [0], [], [], []
    for i in range(len(frames)):
        rows = stixels.rows(i)
        chosen = np.flatnonzero(inside[rows]) + rows.start
        labels = cluster(stixels.points_ego[chosen], stixels.covariances_ego[chosen])
        members = [chosen[labels == label] for label in range(labels.max(initial=-1) + 1)]
        for own in sorted(members, key=lambda one: (stixels.left[one].min(), one[0])):
            of_stixels[own] = len(boxes)
            sides = stixels.left[own].min(), stixels.right[own].max()
            boxes.append((*sides, stixels.top[own].min(), stixels.base[own].max()))
            corners.append(smallest_rectangle(stixels.points_ego[own]))
            counts.append(len(own))
        offsets.append(len(boxes))
    return Objects(
        first=frames.start,
        offsets=np.array(offsets, dtype=np.int64),
        boxes=np.array(boxes, dtype=np.int32).reshape(-1, 4),
        corners_ego=np.array(corners, dtype=np.float64).reshape(-1, 4, 2),
        counts=np.array(counts, dtype=np.int64),
        of_stixels=of_stixels,
    )


def smallest_rectangle(points: np.ndarray) -> np.ndarray:
    """Corners (4, 2) m, in order, of the rectangle of least area that contains `points` (n, 2) m.

    One of its sides is along one of the convex hull's.
    """
    import cv2

    origin = points.mean(axis=0)
    found = cv2.minAreaRect((points - origin).astype(np.float32))
    return cv2.boxPoints(found).astype(np.float64) + origin
