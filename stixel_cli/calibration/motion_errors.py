"""The error of a rig's disparities from the motion of its own camera, without any truth.

A static point of true disparity d moves between two images of the left camera: its flow by the
camera's translation t is proportional to d t / (f B). A point without such a flow is at infinity,
where the measured disparity is the error. So the estimate does not need the length of t: poses from
stereo odometry have a wrong scale if the disparities are wrong.

The points are corners of the first image, tracked by pyramidal Lucas-Kanade (Bouguet 2001). For
each pair of images the motion (three angles, three lengths) is estimated together with the error
that all pairs share, by robust least squares on the places in the second image.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stixel_cli.calibration.disparity_fit import DisparityFit
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings.tables import read_poses
from stixel_cli.recordings.types import Tables
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.disparities import Disparities

TRAVELS = (1.5, 3.0)
"""Least distances from the first to the second image of a pair, m: with less, flow shows little."""

MOST_STEPS = 10
"""Frames from the first to the second image."""

MOST_PAIRS = 150
"""Of images: the unknown motions of all pairs are in one equation."""

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
"""Farther from its place by the poses, px, a point is not static or not tracked."""

PLACE_STD = 0.3
"""Of a tracked place, px: residuals of this size count half (Cauchy's weights)."""

ROUNDS = 30


@dataclass(frozen=True)
class Tracks:
    """Points of static surfaces in two images each, n in all.

    Attributes:
        pairs: (n,) int64, the pair of images; 0, 1, ….
        places: (n, 2) px, u and v in the first image, and moved: (n, 2) px, in the second.
        disparities: (n,) px in the first image, as measured.
        motions: (P, 6) for each pair of images three angles (rad, a rotation vector) and three
            lengths (m), which move points from the first camera's frame to the second's.
    """

    pairs: np.ndarray
    places: np.ndarray
    moved: np.ndarray
    disparities: np.ndarray
    motions: np.ndarray


def track_points(
    pairs: Iterable[StereoPairs],
    disparities: Iterable[Disparities],
    files: tuple[Path, ...],
    rig: Rig,
    tables: Tables,
) -> Tracks:
    """Corners with a disparity in one image, and their places in a later one.

    Args:
        pairs, disparities: chunks in the order of their frames.
        files: the files of the ego poses.
        rig: of the images.
        tables: how the files are written.

    Raises:
        UserError: if the file is not valid.
    """
    # Decoded one by one: all images of a long recording do not fit into the memory.
    images = [(chunk, i) for chunk in pairs for i in range(len(chunk))]
    known = [(chunk, i) for chunk in disparities for i in range(len(chunk))]
    poses = read_poses(files, tables)[tables.first :][: len(images)]
    found, motions = [], []
    for k, step in image_pairs(poses[:, :, 3]):
        motion = motion_between(poses[k], poses[k + step])
        one, other = (chunk.left[i] for chunk, i in (images[k], images[k + step]))
        chunk, i = known[k]
        rows = _tracked(one, other, chunk.pixels(i), motion, rig)
        if len(rows) >= LEAST_POINTS:
            found.append(np.column_stack([np.full(len(rows), len(motions)), rows]))
            motions.append(motion)
    table = np.concatenate([np.zeros((0, 6)), *found])
    return Tracks(
        pairs=table[:, 0].astype(np.int64),
        places=table[:, 1:3],
        moved=table[:, 3:5],
        disparities=table[:, 5],
        motions=np.array(motions).reshape(-1, 6),
    )


def image_pairs(places: np.ndarray) -> list[tuple[int, int]]:
    """First frame and number of steps of each pair of images, from the camera's `places` (K, 3) m.

    For each frame the nearest later ones at the distances `TRAVELS`; of more than `MOST_PAIRS`, so
    many that are evenly spread.
    """
    found = []
    for k in range(len(places)):
        travel = np.linalg.norm(places[k : k + MOST_STEPS + 1] - places[k], axis=1)
        far = [np.flatnonzero(travel >= least) for least in TRAVELS]
        found += [(k, step) for step in sorted({int(one[0]) for one in far if len(one)})]
    if len(found) <= MOST_PAIRS:
        return found
    return [found[i] for i in np.linspace(0, len(found) - 1, MOST_PAIRS).astype(int)]


def motion_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Motion (6,), as in `Tracks`, from one camera pose (3, 4) to another, both in one frame."""
    from scipy.spatial.transform import Rotation

    turn = after[:, :3].T @ before[:, :3]
    shift = after[:, :3].T @ (before[:, 3] - after[:, 3])
    return np.concatenate([Rotation.from_matrix(turn).as_rotvec(), shift])


def fit_motion_error(tracks: Tracks, rig: Rig) -> DisparityFit:
    """Offset and slope of the rig's disparities that the flow of static points shows.

    Both include the present ones of the `rig`. The motions of the pairs of images are unknown too.

    Raises:
        ValueError: if there are too few points.
    """
    if len(tracks.pairs) < LEAST_POINTS:
        raise ValueError("too few static points: the camera must move by 1.5 m within ten frames")
    nothing, motions, before = _solution(tracks, np.zeros(2), tracks.motions, rig, known=True)
    error, _, after = _solution(tracks, nothing, motions, rig, known=False)
    return DisparityFit(
        method="ego motion",
        offset=rig.disparity_offset + float(error[0]),
        slope=rig.disparity_slope + float(error[1]),
        count=len(tracks.pairs),
        unit=f"points in {len(motions)} pairs of images",
        median_before=before,
        median_after=after,
    )


def _solution(
    tracks: Tracks, error: np.ndarray, motions: np.ndarray, rig: Rig, known: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Error (2,), motions (P, 6) and the median residual, px, from a start; or a `known` error.

    Gauss-Newton with Cauchy's weights.
    """
    columns = tracks.places[:, 0] - rig.u0
    # Indices of each point's unknowns in the normal equation.
    unknowns = np.concatenate(
        [np.tile([0, 1], (len(columns), 1)), 2 + 6 * tracks.pairs[:, None] + np.arange(6)], axis=1
    )

    def residuals(error: np.ndarray, motions: np.ndarray) -> np.ndarray:
        true = np.maximum(tracks.disparities - error[0] - error[1] * columns, 0.5)
        return places_after(tracks.places, true, motions[tracks.pairs], rig) - tracks.moved

    steps = np.array([1e-3, 1e-6, *[1e-6] * 3, *[1e-5] * 3])
    for _ in range(ROUNDS):
        now = residuals(error, motions)
        slopes = np.empty((*now.shape, 8))
        for i, step in enumerate(steps):
            moved = np.zeros(8)
            moved[i] = step
            slopes[..., i] = (residuals(error + moved[:2], motions + moved[2:]) - now) / step
        weights = 1.0 / (1.0 + np.sum(now**2, axis=1) / PLACE_STD**2)
        squares = np.einsum("n,nai,naj->nij", weights, slopes, slopes)
        right = np.einsum("n,nai,na->ni", weights, slopes, now)
        normal = np.zeros((2 + motions.size,) * 2)
        side = np.zeros(2 + motions.size)
        np.add.at(normal, (unknowns[:, :, None], unknowns[:, None, :]), squares)
        np.add.at(side, unknowns, right)
        # Relative damping, for unknowns of such different sizes.
        normal += 1e-9 * np.diag(np.diag(normal))
        free = np.arange(2 if known else 0, len(side))
        change = np.zeros(len(side))
        change[free] = np.linalg.solve(normal[np.ix_(free, free)], -side[free])
        error, motions = error + change[:2], motions + change[2:].reshape(-1, 6)
        if np.abs(change).max() < 1e-5:
            break
    return error, motions, float(np.median(np.linalg.norm(residuals(error, motions), axis=1)))


def places_after(
    places: np.ndarray, disparities: np.ndarray, motions: np.ndarray, rig: Rig
) -> np.ndarray:
    """Places (n, 2) px of points after the `motions` (n, 6); `disparities` (n,) px are true."""
    z = rig.focal * rig.baseline / disparities
    points = np.stack(
        [(places[:, 0] - rig.u0) / rig.focal * z, (places[:, 1] - rig.v0) / rig.focal_v * z, z],
        axis=1,
    )
    x, y, z = (_turned(motions[:, :3], points) + motions[:, 3:]).T
    z = np.maximum(z, 0.1)
    return np.stack([rig.focal * x / z + rig.u0, rig.focal_v * y / z + rig.v0], axis=1)


def _turned(angles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) turned by the rotation vectors (n, 3): Rodrigues' formula."""
    size = np.linalg.norm(angles, axis=1)[:, None]
    axis = angles / np.maximum(size, 1e-12)
    along = np.sum(axis * points, axis=1)[:, None]
    across = np.cross(axis, points)
    return points * np.cos(size) + across * np.sin(size) + axis * along * (1.0 - np.cos(size))


def _tracked(
    one: np.ndarray, other: np.ndarray, disparity: np.ndarray, motion: np.ndarray, rig: Rig
) -> np.ndarray:
    """Rows (n, 5) of place (u, v), place in the `other` image and disparity, px.

    The other image is first warped to the view of `one`, by the disparities and the `motion`. Then
    patches differ by a small shift only: without it, near and slanted surfaces, which grow from
    image to image, would be tracked with an error that depends on their depth.
    """
    import cv2

    height, width = disparity.shape
    known = disparity >= LEAST_DISPARITY
    v, u = np.mgrid[:height, :width].astype(np.float64)
    every = np.stack([u.ravel(), v.ravel()], axis=1)
    values = np.where(known, disparity, LEAST_DISPARITY).ravel().astype(np.float64)
    expected = places_after(every, values, np.tile(motion, (len(every), 1)), rig)
    expected = expected.reshape(height, width, 2).astype(np.float32)
    expected[~known] = -1e4
    warped = cv2.remap(other, expected, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    inside = known & (expected >= 0).all(axis=2)
    inside &= (expected[..., 0] < width) & (expected[..., 1] < height)
    # Patches without a pixel that is unknown or has left the image, and without an edge in depth.
    block = np.ones((WINDOW, WINDOW), dtype=np.uint8)
    filled = np.where(known, disparity, 0.0).astype(np.float32)
    mask = cv2.erode(inside.astype(np.uint8), block, borderValue=0)
    near = np.ones((5, 5), dtype=np.uint8)
    mask &= cv2.dilate(filled, near) - cv2.erode(filled, near) <= FLAT
    corners = cv2.goodFeaturesToTrack(one, MOST_POINTS, 0.005, 7, mask=mask)
    if corners is None:
        return np.zeros((0, 5))
    options = {"winSize": (WINDOW, WINDOW), "maxLevel": 2}
    moved, seen, _ = cv2.calcOpticalFlowPyrLK(one, warped, corners, None, **options)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(warped, one, moved, None, **options)
    good = (seen[:, 0] == 1) & (returned[:, 0] == 1)
    good &= np.linalg.norm(back - corners, axis=2)[:, 0] < RETURN
    good &= np.linalg.norm(moved - corners, axis=2)[:, 0] < GREATEST_MISS
    corners, moved = corners[good], moved[good]
    after = cv2.remap(expected, moved, None, cv2.INTER_LINEAR)[:, 0]
    places = corners[:, 0].astype(np.int64)
    measured = cv2.medianBlur(filled, 5)[places[:, 1], places[:, 0]]
    # At the edge of the known pixels the place after the motion is not valid.
    rows = np.column_stack([places, after, measured]).astype(np.float64)
    return rows[(after > 0.0).all(axis=1)]
