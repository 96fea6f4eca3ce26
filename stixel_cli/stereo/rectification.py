"""How far the rows of a pair's images are apart, and whether left and right are exchanged."""

from typing import NamedTuple

import cv2
import numpy as np

from stixel_cli.stereo.matching import one_thread

WARNED, REFUSED = 0.5, 2.0
"""Differences of the rows, px, that are said, and that are refused."""

MOST_NEGATIVE = 0.25
"""Share of the corners with a negative disparity; wrong matches have some, exchanged images all."""

CORNERS, WIDTH = 200, 1300
"""Of each image, and the width, px, to which it is reduced; corners are matched at half of it."""

LEAST_CORNERS, LEAST_SHARE, TOLERANCE = 25, 0.4, 0.7
"""That agree within so many px, and of all: noise, and images of two scenes, have fewer."""


class Rows(NamedTuple):
    """What the corners in a pair's images show.

    Attributes:
        difference: of the rows of a point in both images, px, root mean square over the image.
        fault: what is wrong with the pair, and what to do; None if nothing is.
        refused: whether stixels of the pair would be wrong.
    """

    difference: float
    fault: str | None
    refused: bool


def compare_rows(left: np.ndarray, right: np.ndarray, far_disparity: float) -> Rows | None:
    """How far the rows of two grey images (H, W) uint8 are apart; None without corners enough.

    Corners are matched by their descriptors (Rublee et al. 2011, *ORB*) anywhere in the images, and
    then to a fraction of a pixel by optical flow (Lucas, Kanade 1981). The difference is an offset,
    a roll and a scale that most of them agree on (Fischler, Bolles 1981, *RANSAC*).

    `far_disparity` is that of the rig, px.
    """
    whole = [_at_most(image, WIDTH) for image in (left, right)]
    small = [_at_most(image, WIDTH // 2) for image in whole]
    orb = cv2.ORB_create(CORNERS, nlevels=1, edgeThreshold=16, fastThreshold=12)
    with one_thread():
        (ours, words), (theirs, other_words) = (orb.detectAndCompute(one, None) for one in small)
        if min(len(ours), len(theirs)) < LEAST_CORNERS:
            return None
        matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(words, other_words)
        ratio = np.divide(whole[0].shape[::-1], small[0].shape[::-1])
        one = np.float32([ratio * ours[match.queryIdx].pt for match in matches])
        guess = np.float32([ratio * theirs[match.trainIdx].pt for match in matches])
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
    (height, width), reduced = whole[0].shape, left.shape[1] / whole[0].shape[1]
    roll, scale = fit[1, :2] - [0.0, 1.0]
    mean = reduced * (fit[1, 2] + roll * 0.5 * (width - 1) + scale * 0.5 * (height - 1))
    uneven = reduced * np.hypot(roll * width, scale * height) / np.sqrt(12.0)
    difference = float(np.hypot(mean, uneven))
    negative = np.mean(reduced * (one - other)[agree, 0] < far_disparity - 1.0)
    if negative >= MOST_NEGATIVE:
        fault = (
            f"{negative:.0%} of the disparities are negative: exchange left and right; or state "
            "rig.principal_u_right, if the principal points of the cameras differ"
        )
    elif difference >= WARNED:
        parts = f"mean {mean:+.1f} px, roll {np.degrees(roll):.1f}°, scale {scale:+.1%}"
        fault = f"the rows of the two images differ by {difference:.1f} px ({parts}): rectify them"
    else:
        fault = None
    return Rows(difference, fault, negative >= MOST_NEGATIVE or difference >= REFUSED)


def _at_most(image: np.ndarray, width: int) -> np.ndarray:
    """The image, reduced to `width` px if it is wider."""
    if image.shape[1] <= width:
        return image
    height = round(image.shape[0] * width / image.shape[1])
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
