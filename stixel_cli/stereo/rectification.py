"""The vertical disparity of a pair of images, and whether left and right are exchanged."""

from typing import NamedTuple

import cv2
import numpy as np

from stixel_cli.rendering.images import reduced
from stixel_cli.stereo.matching import one_thread

WARNED, REFUSED = 0.5, 2.0
"""Differences of the rows, px, from which on a warning is given, and the pair is refused."""

MOST_NEGATIVE = 0.25
"""Share of corners with a negative disparity: wrong matches give a few, exchanged images all."""

CORNERS, EDGE, WIDTH = 100, 16, 1300
"""Number of corners in each half of an image, their distance from its edge, and the width to which
images are reduced, px. Corners are found and matched at half that width."""

LEAST_CORNERS, LEAST_SHARE, TOLERANCE = 25, 0.4, 0.7
"""Least number and share of corners that agree with the fit, within `TOLERANCE` px: noise, and
images of two scenes, have fewer."""


class Rows(NamedTuple):
    """The comparison of the corners in a pair's images."""

    difference: float
    """Vertical disparity, px: the root mean square over the lower half of the image."""
    fault: str | None
    """The fault of the pair, and the remedy; None without a fault."""
    refused: bool
    """Whether the fault makes stixels wrong."""


def compare_rows(left: np.ndarray, right: np.ndarray, far_disparity: float) -> Rows | None:
    """The vertical disparity of two grey images (H, W) uint8; None with too few corners.

    Corners are matched by their descriptors (Rublee et al. 2011, *ORB*), then to a fraction of a
    pixel by optical flow (Lucas, Kanade 1981). Offset, roll and scale of the rows are a robust fit
    (Fischler, Bolles 1981, *RANSAC*). `far_disparity` is that of the rig, px.
    """
    whole = [reduced(image, WIDTH) for image in (left, right)]
    small = [reduced(image, WIDTH // 2) for image in whole]
    with one_thread():
        (ours, words), (theirs, other_words) = map(_corners, small)
        if min(len(ours), len(theirs)) < LEAST_CORNERS:
            return None
        matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(words, other_words)
        ratio = np.divide(whole[0].shape[::-1], small[0].shape[::-1])
        one = np.float32([ratio * ours[match.queryIdx] for match in matches])
        guess = np.float32([ratio * theirs[match.trainIdx] for match in matches])
        flow = {"winSize": (13, 13), "maxLevel": 1, "flags": cv2.OPTFLOW_USE_INITIAL_FLOW}
        other, tracked, _ = cv2.calcOpticalFlowPyrLK(*whole, one, guess.copy(), **flow)
        good = (tracked[:, 0] == 1) & (np.abs(other - guess).max(axis=1) < 4.0)
        one, other = one[good], other[good]
        if len(one) < LEAST_CORNERS:
            return None
        # Columns are left out: those of the left image are in both.
        rows = np.stack([one[:, 0], other[:, 1]], axis=1)
        fit, agree = cv2.estimateAffine2D(one, rows, ransacReprojThreshold=TOLERANCE)
    agree = agree[:, 0] == 1
    if fit is None or agree.sum() < max(LEAST_CORNERS, LEAST_SHARE * len(one)):
        return None
    (height, width), factor = whole[0].shape, left.shape[1] / whole[0].shape[1]
    roll, scale = fit[1, :2] - [0.0, 1.0]
    # Of the lower half, which shows the road and the feet of obstacles.
    mean = factor * (fit[1, 2] + roll * 0.5 * (width - 1) + scale * 0.75 * (height - 1))
    uneven = factor * np.hypot(roll * width, scale * 0.5 * height) / np.sqrt(12.0)
    difference = float(np.hypot(mean, uneven))
    negative = np.mean(factor * (one - other)[agree, 0] < far_disparity - 1.0)
    fault = None
    if negative >= MOST_NEGATIVE:
        fault = (
            f"{negative:.0%} of the disparities are negative: exchange left and right; or set "
            "rig.principal_u_right if the principal points of the cameras differ"
        )
    elif difference >= WARNED:
        parts = f"mean {mean:+.1f} px, roll {np.degrees(roll):.1f}°, scale {scale:+.1%}"
        fault = f"the rows of the two images differ by {difference:.1f} px ({parts}): rectify them"
    return Rows(difference, fault, negative >= MOST_NEGATIVE or difference >= REFUSED)


def _corners(image: np.ndarray) -> tuple[list[tuple[float, float]], np.ndarray]:
    """Places (u, v) and descriptors (n, 32) of corners, found in both halves of a grey image.

    The strongest ones alone are of buildings: the rows of the road would be extrapolated.
    """
    orb = cv2.ORB_create(CORNERS, nlevels=1, edgeThreshold=EDGE, fastThreshold=12)
    middle = image.shape[0] // 2
    places, descriptors = [], [np.empty((0, 32), np.uint8)]
    for first, last in ((0, middle + EDGE), (max(middle - EDGE, 0), image.shape[0])):
        corners, described = orb.detectAndCompute(image[first:last], None)
        places += [(corner.pt[0], corner.pt[1] + first) for corner in corners]
        descriptors += [described] if corners else []
    return places, np.concatenate(descriptors)
