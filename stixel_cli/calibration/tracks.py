"""Static points of a recording, tracked: what shows the error of a rig without any truth.

A static point of true disparity d moves between two images of the left camera: its flow by the
camera's translation t is proportional to d t / (f B). A point without such a flow is at infinity,
where the measured disparity is the error. So neither the length of t nor any pose is needed.

The points are corners of an image with a disparity. They are tracked by pyramidal Lucas-Kanade
(Bouguet 2001) until the camera, located by these points (PnP with RANSAC), has moved far enough.
`motion_fit` estimates the motion of each such pair of images, and the error that all share.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stixel_cli.geometry.rig import Rig

TRAVELS = (1.5, 3.0)
"""Least distances from the first to the second image of a pair, m: with less, flow shows little."""

MOST_STEPS = 10
"""Frames from the first to the second image."""

MOST_POINTS = 500
"""Per pair of images."""

LEAST_POINTS = 30
"""Per pair of images; with fewer, the pair is left out."""

LEAST_DISPARITY = 3.0
"""Of a point, px."""

FLAT = 1.0
"""Greatest difference of the disparities in the 5 × 5 pixels round a point, px: no edges."""

RETURN = 0.5
"""Greatest distance from a point to itself, tracked there and back, px."""

WINDOW = 11
"""Side of the tracked patches, px."""

GREATEST_MISS = 8.0
"""Farther from its place by the motion, px, a point is not static or not tracked."""


@dataclass(frozen=True)
class Tracks:
    """Points of static surfaces in two images each, n in all, in P pairs of images."""

    pairs: np.ndarray
    """(n,) int64, the pair of images; 0, 1, …, increasing."""
    places: np.ndarray
    """(n, 2) px, u and v in the first image."""
    moved: np.ndarray
    """(n, 2) px, in the second image."""
    disparities: np.ndarray
    """(n,) px in the first image, as measured: with the rig's whole error."""
    frames: np.ndarray
    """(P, 2) int64, the first and the second image of each pair."""
    rotations: np.ndarray
    shifts: np.ndarray
    """`rotations` (P, 3, 3) and `shifts` (P, 3) m move points from the first camera's frame to the
    second's."""

    def chosen(self, pairs: np.ndarray) -> "Tracks":
        """Those of some pairs of images, given by (P,) bool."""
        points, number = pairs[self.pairs], np.cumsum(pairs) - 1
        ofpoints = (getattr(self, name)[points] for name in ("places", "moved", "disparities"))
        ofpairs = (getattr(self, name)[pairs] for name in ("frames", "rotations", "shifts"))
        return Tracks(number[self.pairs[points]], *ofpoints, *ofpairs)


Pair = tuple[int, int, np.ndarray, np.ndarray, np.ndarray]
"""First image, number of steps, rows (n, 5) as of `_tracked`, rotation, shift: of one pair."""


def gathered(found: Sequence[Pair]) -> Tracks:
    """The tracks of all pairs of images."""
    rows = [np.column_stack([np.full(len(one[2]), i), one[2]]) for i, one in enumerate(found)]
    table = np.concatenate([np.zeros((0, 6)), *rows])
    return Tracks(
        pairs=table[:, 0].astype(np.int64),
        places=table[:, 1:3],
        moved=table[:, 3:5],
        disparities=table[:, 5],
        frames=np.array([(k, k + step) for k, step, *_ in found], dtype=np.int64).reshape(-1, 2),
        rotations=np.array([one[3] for one in found]).reshape(-1, 3, 3),
        shifts=np.array([one[4] for one in found]).reshape(-1, 3),
    )


def followed(
    images: Iterable[np.ndarray], disparity: np.ndarray, rig: Rig
) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """Steps, rows as of `_tracked`, rotation and shift to the later images at the `TRAVELS`.

    The `images` are grey, (H, W) uint8; the first has the `disparity` (H, W) px, NaN where unknown.
    """
    import cv2

    images = iter(images)
    one = before = next(images)
    disparity = np.nan_to_num(disparity).astype(np.float32)
    # Patches without a pixel that is unknown, and without an edge in depth.
    known = (disparity >= LEAST_DISPARITY).astype(np.uint8)
    mask = cv2.erode(known, np.ones((WINDOW, WINDOW), dtype=np.uint8), borderValue=0)
    near = np.ones((5, 5), dtype=np.uint8)
    mask &= cv2.dilate(disparity, near) - cv2.erode(disparity, near) <= FLAT
    corners = cv2.goodFeaturesToTrack(one, MOST_POINTS, 0.005, 7, mask=mask)
    if corners is None:
        return
    u, v = corners[:, 0].astype(int).T
    measured = cv2.medianBlur(disparity, 5)[v, u].astype(np.float64)
    points, moved = points_at(corners[:, 0].astype(np.float64), measured, rig), corners
    goals = list(TRAVELS)
    for step, image in enumerate(images, 1):
        moved, seen, _ = cv2.calcOpticalFlowPyrLK(before, image, moved, None)
        lost, before = seen[:, 0] == 0, image
        points[lost] = np.nan
        left = np.isfinite(points[:, 0])
        if left.sum() < LEAST_POINTS:
            return
        found = cv2.solvePnPRansac(points[left], moved[left], rig.camera_matrix, None)
        if not found[0]:
            return
        rotation, shift = cv2.Rodrigues(found[1])[0], found[2][:, 0]
        if (travel := np.linalg.norm(shift)) < goals[0]:
            continue
        after = _tracked(one, image, corners, disparity, (rotation, shift), rig)
        good = np.isfinite(after[:, 0])
        if good.sum() >= LEAST_POINTS:
            rows = np.column_stack([corners[:, 0], after, measured])[good]
            yield step, rows, rotation, shift
        goals = [goal for goal in goals if goal > travel]
        if not goals:
            return


def points_at(places: np.ndarray, disparities: np.ndarray, rig: Rig) -> np.ndarray:
    """Points (n, 3) m in the camera's frame of `places` (n, 2) px with true `disparities` (n,)."""
    beside = (places - [rig.u0, rig.v0]) / [rig.focal, rig.focal_v]
    rays = np.column_stack([beside, np.ones(len(places))])
    return rays * rig.depth_from_disparity(disparities)[:, None]


def places_of(points: np.ndarray, rig: Rig) -> np.ndarray:
    """Places (n, 2) px of points (n, 3) m in the camera's frame."""
    ahead = np.maximum(points[:, 2:], 0.1)
    return points[:, :2] / ahead * [rig.focal, rig.focal_v] + [rig.u0, rig.v0]


def _tracked(
    one: np.ndarray,
    other: np.ndarray,
    corners: np.ndarray,
    disparity: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray],
    rig: Rig,
) -> np.ndarray:
    """Places (n, 2) px in the `other` image of `corners` (n, 1, 2); NaN where they are not found.

    The other image is first warped to the view of `one`, by the disparities and the `motion`. Then
    patches differ by a small shift only: without it, near and slanted surfaces, which grow from
    image to image, would be tracked with an error that depends on their depth.
    """
    import cv2

    # A place (u, v, 1) with disparity d moves to K R K⁻¹ (u, v, 1) + K t d / (f B).
    rotation, shift = motion
    camera = rig.camera_matrix
    by_place = camera @ rotation @ np.linalg.inv(camera)
    by_disparity = camera @ shift / (rig.focal * rig.baseline)
    matrix = np.column_stack([by_place[:, :2], by_disparity, by_place[:, 2]])
    height, width = disparity.shape
    v, u = np.mgrid[:height, :width].astype(np.float32)
    after = cv2.transform(np.dstack([u, v, disparity]), matrix)
    expected = after[..., :2] / np.maximum(after[..., 2:], np.float32(0.01))
    warped = cv2.remap(other, expected, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    options = {"winSize": (WINDOW, WINDOW), "maxLevel": 2}
    moved, seen, _ = cv2.calcOpticalFlowPyrLK(one, warped, corners, None, **options)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(warped, one, moved, None, **options)
    places = cv2.remap(expected, moved, None, cv2.INTER_LINEAR)[:, 0]
    margin = WINDOW // 2
    good = (seen[:, 0] == 1) & (returned[:, 0] == 1)
    good &= np.linalg.norm(back - corners, axis=2)[:, 0] < RETURN
    good &= np.linalg.norm(moved - corners, axis=2)[:, 0] < GREATEST_MISS
    inside = (places >= margin) & (places < [width - margin, height - margin])
    good &= inside.all(axis=1)
    return np.where(good[:, None], places, np.nan)
