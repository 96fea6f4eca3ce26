from dataclasses import replace

import cv2
import numpy as np
import pytest
from projection import nearest_of

from stixel_cli.geometry.rig import Rig
from stixel_cli.images import ImageStack
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.disparities import INVALID
from stixel_cli.stereo.matching import HOLE, SgmParameters, combined, halved, match

FAR, NEAR = 12, 90
BOX = slice(20, 75), slice(180, 260)
"""Rows and columns of the near plane in the left image."""

RIG = Rig(321, 97, 200.0, None, None, None, 0.5, 1.2, 0.0, None)


STEREO = SgmParameters(
    kind="sgm",
    nearest=nearest_of(RIG, 112),
    block_size=5,
    subpixel="phase_table",
    disparities_at_full_size=32,
)


@pytest.fixture(scope="module")
def pairs():
    """A near box in front of a far plane, both of random dots; odd sizes."""
    dots = np.random.default_rng(3).integers(0, 256, (2, 97, 321 + FAR), dtype=np.uint8)
    far, near = (cv2.GaussianBlur(image, (3, 3), 0) for image in dots)
    left, right = far[:, :321].copy(), far[:, FAR:].copy()
    rows, columns = BOX
    left[BOX] = near[BOX]
    right[rows, columns.start - NEAR : columns.stop - NEAR] = near[BOX]
    return StereoPairs(0, *(ImageStack.from_images([image]) for image in (left, right)))


def shrunk(box, pixels):
    return tuple(slice(side.start + pixels, side.stop - pixels) for side in box)


@pytest.mark.parametrize("subpixel", ["parabola", "phase_table"])
def test_near_and_far_planes_are_found(pairs, subpixel):
    stereo = replace(STEREO, subpixel=subpixel)
    disparities = match(pairs, stereo, RIG, range(1))
    assert disparities.count == 112
    raw = disparities.raw(0)
    assert raw.shape == (97, 321) and raw.dtype == np.int16
    valid = raw != INVALID
    box = raw[shrunk(BOX, 6)]
    assert np.mean(box != INVALID) > 0.95
    assert np.all(np.abs(box[box != INVALID] - 16 * NEAR) <= 8)
    # Left of the box, the right camera sees the box in front of the far plane. What is matched
    # there next to the far plane is mostly of it.
    rows, first, last = BOX[0], BOX[1].start - NEAR + FAR, BOX[1].stop
    outside = np.zeros(raw.shape, dtype=bool)
    outside[:, FAR + 6 : -6] = True
    outside[rows.start - 6 : rows.stop + 6, first - 6 : last + 6] = False
    assert np.mean(valid[outside]) > 0.95
    assert np.all(np.abs(raw[outside & valid] - 16 * FAR) <= 8)
    hidden = raw[rows, first + 6 : BOX[1].start - 6]
    assert np.mean((hidden != INVALID) & (np.abs(hidden - 16 * FAR) > 48)) < 0.1


def test_a_near_plane_is_found_up_to_the_left_border():
    """A point in column u with a disparity above u is outside the right image."""
    dots = np.random.default_rng(5).integers(0, 256, (64, 320 + NEAR), dtype=np.uint8)
    dots = cv2.GaussianBlur(dots, (3, 3), 0)
    views = dots[:, :320], dots[:, NEAR:]
    pair = StereoPairs(0, *(ImageStack.from_images([view]) for view in views))
    raw = match(pair, STEREO, replace(RIG, width=320, height=64), range(1)).raw(0)
    assert np.all(raw <= 16 * np.arange(320))
    assert np.all(raw[:, : NEAR - 1] == INVALID)
    assert np.mean(raw[:, NEAR : NEAR + 4] != INVALID) > 0.5
    assert np.mean(np.abs(raw[4:-4, NEAR + 4 : -6] - 16 * NEAR) <= 8) > 0.95


def test_a_small_range_is_searched_at_full_size_only(pairs):
    small = replace(STEREO, nearest=nearest_of(RIG, 32))
    found = match(pairs, small, RIG, range(1))
    plain = match(pairs, replace(small, disparities_at_full_size=None), RIG, range(1))
    assert found.stored.encoded == plain.stored.encoded


def test_tiny_images_are_matched_at_two_sizes():
    views = (np.zeros((3, 5), dtype=np.uint8),) * 2
    pair = StereoPairs(0, *(ImageStack.from_images([view]) for view in views))
    found = match(pair, STEREO, replace(RIG, width=5, height=3), range(1))
    assert found.raw(0).shape == (3, 5)


def test_an_image_is_halved_by_means_of_two_by_two_pixels():
    image = np.array([[0, 4, 8, 8, 7], [4, 8, 8, 8, 7], [10, 20, 30, 40, 50]], dtype=np.uint8)
    assert halved(image).tolist() == [[4, 8, 7], [15, 35, 50]]


def test_both_sizes_are_combined_pixel_by_pixel():
    rng = np.random.default_rng(8)
    full = rng.integers(0, 32 * 16, (40, 60)).astype(np.int16)
    half = rng.integers(1, 60 * 16, (20, 30)).astype(np.int16)
    # Some agree, some have no match, and some have no match near them.
    full[::2, ::2] = 2 * half + rng.integers(-40, 40, half.shape)
    full[(full < 0) | (full >= 32 * 16) | (rng.random(full.shape) < 0.1)] = INVALID
    half[rng.random(half.shape) < 0.3] = half[5:18, 4:17] = INVALID
    full[20:24, 20:24] = 4
    found = combined(full, half, 32, 100)
    kinds = set()
    for v, u in np.ndindex(full.shape):
        a, b = int(full[v, u]), int(half[v // 2, u // 2])
        rows, columns = (slice(max(i // 2 - HOLE, 0), i // 2 + HOLE + 1) for i in (v, u))
        around = half[rows, columns]
        around = around[around != INVALID].tolist()
        of_half = [b] if b != INVALID else [min(around), max(around)] if around else []
        if a != INVALID and any(abs(a - 2 * d) <= 32 for d in of_half):
            expected, kind = a, "agree" if b != INVALID else "hole"
        elif 30 * 16 <= 2 * b < 100 * 16:
            expected, kind = 2 * b, "near"
        else:
            expected, kind = INVALID, "invalid" if around else "nothing near"
        assert found[v, u] == expected
        kinds.add(kind)
    assert kinds == {"agree", "hole", "near", "invalid", "nothing near"}
    assert found.dtype == np.int16
