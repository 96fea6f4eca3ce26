"""Matching at full size and at half of it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from constants import with_constants
from projection import nearest_of

from stixel_cli.config.compose import compose
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import ImageStack
from stixel_cli.stereo.disparities import INVALID
from stixel_cli.stereo.matching import (
    HOLE,
    PHASE_TABLE,
    BmParameters,
    SgmParameters,
    combined,
    correct_phases,
    corrected,
    disparity_count,
    halved,
    match,
)

SHIFT = 10
FRAMES = range(7, 9)
RIG = Rig(160, 96, 60.0, None, None, None, 0.3, 1.2, 0.0, None)


NEAREST = nearest_of(RIG, 32)
PLAIN = SgmParameters(kind="sgm", nearest=NEAREST, block_size=3, subpixel="parabola")
SGM = with_constants(PLAIN, p1=200, p2=800, pre_filter_cap=31, speckle_window=0)
BM = with_constants(BmParameters(kind="bm", nearest=NEAREST, block_size=9), speckle_window=0)


@pytest.fixture(scope="module")
def pairs():
    """A textured plane, SHIFT px apart in the two views."""
    noise = np.random.default_rng(1).integers(0, 256, (96, 160 + SHIFT), dtype=np.uint8)
    texture = cv2.GaussianBlur(noise, (3, 3), 0)
    left, right = texture[:, :160], texture[:, SHIFT:]
    stacks = (ImageStack.from_images([image, image]) for image in (left, right))
    return StereoPairs(FRAMES.start, *stacks)


@pytest.mark.parametrize("stereo", [SGM, BM])
def test_the_plane_is_found_up_to_the_left_border(pairs, stereo):
    disparities = match(pairs, stereo, RIG, FRAMES)
    assert (disparities.first, disparities.count, len(disparities)) == (7, 32, 2)
    raw = disparities.raw(0)
    assert raw.shape == (96, 160)
    assert np.all(raw <= 16 * np.arange(160))
    seen = raw[6:-6, SHIFT + 6 : -6]
    assert np.mean(seen != INVALID) > 0.95
    assert np.mean(np.abs(seen[seen != INVALID] - 16 * SHIFT) <= 2) > 0.99
    if stereo is SGM:
        assert np.mean(raw[:, SHIFT : SHIFT + 4] != INVALID) > 0.5


@pytest.mark.parametrize("stereo", [SGM, BM, replace(SGM, disparities_at_full_size=16)])
def test_matching_is_repeatable_and_restores_the_threads(pairs, stereo):
    threads = cv2.getNumThreads()
    first, second = (match(pairs, stereo, RIG, FRAMES) for _ in range(2))
    assert first.stored.encoded == second.stored.encoded
    assert cv2.getNumThreads() == threads


@pytest.mark.parametrize("stereo", [SGM, BM])
def test_disparity_count_follows_the_rig(stereo):
    derived = replace(stereo, nearest=3.5)
    count = disparity_count(derived, RIG)
    assert count % 16 == 0
    assert count > RIG.disparity_from_depth(3.5) >= count - 17
    assert disparity_count(replace(derived, nearest=90.0), RIG) == 16
    assert disparity_count(stereo, RIG) == 32


@pytest.mark.parametrize(("greatest", "count"), [(100.0, 112), (110.9, 112), (111.1, 128)])
def test_disparity_count_includes_one_value_beyond_the_nearest_point(greatest, count):
    """The sub-pixel parabola at `greatest` px needs the one behind it."""
    nearest = RIG.focal * RIG.baseline / greatest
    assert disparity_count(replace(SGM, nearest=nearest), RIG) == count


def test_the_table_removes_the_bias_towards_whole_pixels():
    """A plane at a quarter, a half and three quarters of a pixel, drawn from a fine texture."""
    noise = np.random.default_rng(4).integers(0, 256, (96, 4 * 200)).astype(np.float32)
    fine = cv2.GaussianBlur(noise, (0, 0), 5.0)
    fine = np.clip(128 + 6 * (fine - fine.mean()), 0, 255).astype(np.uint8)
    errors = {"parabola": [], "phase_table": []}
    for quarters in (41, 42, 43):
        left, right = fine[:, : 4 * 160 : 4], fine[:, quarters : quarters + 4 * 160 : 4]
        pair = StereoPairs(0, *(ImageStack.from_images([image]) for image in (left, right)))
        for subpixel, of_kind in errors.items():
            stereo = compose([f"stereo.subpixel={subpixel}"]).configuration.stereo
            pixels = match(pair, stereo, RIG, range(1)).pixels(0)[8:-8, 24:-8]
            of_kind.append(np.abs(np.nanmedian(pixels) - quarters / 4))
    assert max(errors["phase_table"]) <= 1 / 16
    assert sum(errors["phase_table"]) < sum(errors["parabola"])


def test_the_phase_table_corrects_every_surface_and_keeps_edges_and_holes():
    table = np.array(PHASE_TABLE)
    assert table[0] == 0 and table[8] == 8
    assert np.all(table[1:] + table[:0:-1] == 16) and np.all(np.diff(table) >= 0)
    raw = np.full((9, 24), 16 * 10 + 2, dtype=np.int16)
    raw[:, 12:] = 16 * 10 + 14
    raw[2, 3] = raw[6, 23] = INVALID
    found = correct_phases(raw)
    assert found.dtype == np.int16
    expected = np.where(raw == INVALID, INVALID, raw - 2 + PHASE_TABLE[2])
    expected[:, 12:] = np.where(raw[:, 12:] == INVALID, INVALID, 16 * 10 + PHASE_TABLE[14])
    assert np.array_equal(found, expected)
    raw = np.zeros((9, 9), dtype=np.int16)
    raw[4, 4] = raw[:, 7:] = INVALID
    assert np.array_equal(correct_phases(raw), raw)
    raw = np.full((9, 9), 160, dtype=np.int16)
    raw[4, 4] = 161
    assert np.all(correct_phases(raw) == 160)
    raw[4, 4] = 168
    assert correct_phases(raw)[4, 4] == 168


def test_the_errors_of_the_rig_are_taken_off_column_by_column(pairs):
    plain = match(pairs, SGM, RIG, FRAMES).raw(1).astype(int)
    wrong = replace(RIG, disparity_error=(-0.5, 0.01 * RIG.focal, 1.0))
    found = match(pairs, SGM, wrong, FRAMES).raw(1).astype(int)
    away = np.arange(160) - 79.5
    errors = np.rint(16 * (-0.5 + 0.01 * away + (away / RIG.focal) ** 2)).astype(int)
    assert errors.min() < 0 < errors.max()
    both = (plain != INVALID) & (found != INVALID)
    assert both.mean() > 0.8 and ((found == INVALID) >= (plain == INVALID)).all()
    assert (found == plain - errors)[both].all()


@pytest.mark.parametrize("distance", [25.25, -25.25])
def test_the_distance_of_the_principal_points_is_taken_off(pairs, distance):
    """It may exceed the range that is searched; its fraction is rounded as other errors are."""
    moved = round(distance)
    left, right = pairs.left[0], pairs.right[0]
    # A right camera whose principal point is farther right sees everything farther right.
    seen = np.roll(right, moved, axis=1)
    apart = StereoPairs(0, *(ImageStack.from_images([image]) for image in (left, seen)))
    rig = replace(RIG, principal_u_right=RIG.u0 + distance)
    found = match(apart, SGM, rig, range(1)).raw(0).astype(int)
    plain = match(pairs, SGM, RIG, FRAMES).raw(0).astype(int)
    # Away from the borders, near which a path of the matcher has other neighbours.
    inside = np.s_[:, 40:110]
    both = (plain != INVALID) & (found != INVALID)
    assert both[inside].mean() > 0.9
    assert np.mean((found == plain + 16 * (distance - moved))[inside][both[inside]]) > 0.99
    # What the other camera cannot see has no match.
    u = np.arange(160) - found / 16 + distance
    assert ((u > -1) & (u < 160))[found != INVALID].all()


def test_a_disparity_that_the_correction_takes_out_of_range_is_invalid():
    raw = np.array([[0, 5, 500, INVALID]], dtype=np.int16)
    found = corrected(raw, np.array([8, -8, -16, 0], dtype=np.int16), 32)
    assert found.tolist() == [[INVALID, 13, INVALID, INVALID]]


FAR, NEAR = 12, 90
BOX = slice(20, 75), slice(180, 260)
"""Rows and columns of the near plane in the left image."""

WIDE = Rig(321, 97, 200.0, None, None, None, 0.5, 1.2, 0.0, None)


SIZES = {"block_size": 5, "disparities_at_full_size": 32}
STEREO = SgmParameters(kind="sgm", nearest=nearest_of(WIDE, 112), subpixel="phase_table", **SIZES)


@pytest.fixture(scope="module")
def planes():
    """A near box in front of a far plane, both of random dots; odd sizes."""
    dots = np.random.default_rng(3).integers(0, 256, (2, 97, 321 + FAR), dtype=np.uint8)
    far, near = (cv2.GaussianBlur(image, (3, 3), 0) for image in dots)
    left, right = far[:, :321].copy(), far[:, FAR:].copy()
    rows, columns = BOX
    left[BOX] = near[BOX]
    right[rows, columns.start - NEAR : columns.stop - NEAR] = near[BOX]
    return StereoPairs(0, *(ImageStack.from_images([image]) for image in (left, right)))


@pytest.mark.parametrize("subpixel", ["parabola", "phase_table"])
def test_near_and_far_planes_are_found(planes, subpixel):
    stereo = replace(STEREO, subpixel=subpixel)
    disparities = match(planes, stereo, WIDE, range(1))
    assert disparities.count == 112
    raw = disparities.raw(0)
    assert raw.shape == (97, 321) and raw.dtype == np.int16
    valid = raw != INVALID
    box = raw[tuple(slice(side.start + 6, side.stop - 6) for side in BOX)]
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
    raw = match(pair, STEREO, replace(WIDE, width=320, height=64), range(1)).raw(0)
    assert np.all(raw <= 16 * np.arange(320))
    assert np.all(raw[:, : NEAR - 1] == INVALID)
    assert np.mean(raw[:, NEAR : NEAR + 4] != INVALID) > 0.5
    assert np.mean(np.abs(raw[4:-4, NEAR + 4 : -6] - 16 * NEAR) <= 8) > 0.95


def test_a_small_range_is_searched_at_full_size_only(planes):
    small = replace(STEREO, nearest=nearest_of(WIDE, 32))
    found = match(planes, small, WIDE, range(1))
    plain = match(planes, replace(small, disparities_at_full_size=None), WIDE, range(1))
    assert found.stored.encoded == plain.stored.encoded


def test_images_are_halved_by_means_and_tiny_ones_are_matched_at_two_sizes():
    views = (np.zeros((3, 5), dtype=np.uint8),) * 2
    pair = StereoPairs(0, *(ImageStack.from_images([view]) for view in views))
    found = match(pair, STEREO, replace(WIDE, width=5, height=3), range(1))
    assert found.raw(0).shape == (3, 5)
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
