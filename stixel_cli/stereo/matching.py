"""Stereo matching by OpenCV: semi-global, or of blocks.

Semi-global matching is that of Hirschmüller 2008, block matching that of Konolige 1997. Large
disparities may come from images of half the size, which also check the small ones.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, MultipleOf

from stixel_cli.geometry.rig import Rig
from stixel_cli.parameters import parameters
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.rendering.images import ImageStack
from stixel_cli.stereo.disparities import INVALID, SUBPIXELS, Disparities

BLOCK = 16
"""OpenCV searches a multiple of this many disparities."""


@parameters(kw_only=True)
class MatchingParameters:
    """Parameters of both matchers.

    Attributes:
        kind: which matcher it is.
        nearest: least depth that must be measurable, m: so many disparities are searched as an
            object there needs with the rig at hand.
        block_size: side of the matched block, px, odd, below the image's sides.
    """

    kind: str
    nearest: Annotated[float, Gt(0), Le(100)]
    block_size: int

    # OpenCV's checks of a match, at values that its documentation recommends.
    left_right_difference: ClassVar[int] = 1
    """Greatest difference of the left and the right view's disparity, px."""
    pre_filter_cap: ClassVar[int]
    """Bound of the filtered image that is matched, grey levels: OpenCV's own for each matcher."""
    uniqueness_ratio: ClassVar[int] = 10
    """Per cent by which the best cost must beat the others."""
    speckle_window: ClassVar[int] = 100
    """Smaller regions of even disparity are invalid, px²."""
    speckle_range: ClassVar[int] = 2
    """Greatest disparity step inside such a region, px."""

    def check(self, rig: Rig) -> None:
        """Raise ValueError if the parameters contradict each other, or do not suit the rig."""
        if self.block_size % 2 == 0:
            raise ValueError(f"stereo.block_size: must be odd, got {self.block_size}")
        if self.block_size >= min(rig.width, rig.height):
            raise ValueError(
                f"stereo.block_size: must be smaller than the image, {rig.width} × {rig.height}, "
                f"got {self.block_size}"
            )
        # In Python floats, because NumPy's warn on overflow.
        greatest = float(rig.focal) * float(rig.baseline) / float(self.nearest)
        if greatest >= rig.width:
            raise ValueError(
                f"stereo.nearest: at {self.nearest:g} m the disparity is {greatest:.0f} px; it "
                f"must be < rig.width ({rig.width})"
            )


@dataclass(frozen=True, kw_only=True)
class SgmParameters(MatchingParameters):
    """Semi-global matching, Hirschmüller 2008, as OpenCV's StereoSGBM; it filters by x-derivative.

    Attributes:
        subpixel: how the pull of the sub-pixel parabola to whole pixels is corrected. "parabola":
            not at all; "phase_table": by a table fitted to this matcher, and a median.
        disparities_at_full_size: number of disparities searched on whole images, px, a multiple of
            16; null, or a number that is not below that of all disparities: all. Images of half the
            size then give the larger ones, and check the others. The check of left and right and
            the speckles are then in pixels of these images.
    """

    kind: Literal["sgm"]
    block_size: Annotated[int, Ge(1), Le(21)]
    subpixel: Literal["parabola", "phase_table"]
    disparities_at_full_size: Annotated[int, Ge(BLOCK), Le(1024), MultipleOf(BLOCK)] | None = None

    pre_filter_cap: ClassVar[int] = 63
    p1: ClassVar[int] = 100
    """Penalty of a disparity change by one between neighbours."""
    p2: ClassVar[int] = 2400
    """Penalty of a greater change between neighbours."""


@dataclass(frozen=True, kw_only=True)
class BmParameters(MatchingParameters):
    """Block matching, Konolige 1997, as OpenCV's StereoBM; it filters by x-derivative."""

    kind: Literal["bm"]
    block_size: Annotated[int, Ge(5), Le(255)]

    subpixel: ClassVar[str] = "parabola"
    disparities_at_full_size: ClassVar[None] = None
    pre_filter_cap: ClassVar[int] = 31
    texture_threshold: ClassVar[int] = 10
    """Blocks whose summed filter response is below it are invalid: OpenCV's own value."""


StereoParameters = SgmParameters | BmParameters


def disparity_count(stereo: MatchingParameters, rig: Rig) -> int:
    """Number of disparities to search, a multiple of `BLOCK`.

    Enough for the depth `stereo.nearest` with this rig, thesis (3), and one more for the sub-pixel
    parabola's neighbour.
    """
    greatest = float(rig.disparity_from_depth(stereo.nearest)) + 1.0
    return BLOCK * max(1, int(np.ceil(greatest / BLOCK)))


def match(pairs: StereoPairs, stereo: StereoParameters, rig: Rig, frames: range) -> Disparities:
    """Disparities of the left views of `frames`, 1/16 px, on one thread.

    The left border keeps its disparities as far as the right image reaches: a point in column u
    with a disparity above u is outside the right image, so it is invalid. Block matching loses half
    a block at the other three borders. The errors of the `rig`'s disparities are corrected, rounded
    to 1/16 px. If the cameras' principal points differ, the right image is first moved by that
    distance, in whole px.
    """
    count, shift = disparity_count(stereo, rig), round(rig.far_disparity)
    errors = np.rint(SUBPIXELS * (rig.disparity_errors() - shift)).astype(np.int16)
    columns = np.arange(rig.width, dtype=np.int32)
    moved = np.clip(columns - shift, 0, rig.width - 1)
    full, half = _matcher(stereo, count), None
    at_full_size = stereo.disparities_at_full_size
    if at_full_size is not None and at_full_size < count:
        full = _matcher(stereo, at_full_size)
        half = _matcher(stereo, BLOCK * -(-count // (2 * BLOCK)))
    raw = []
    with one_thread():
        for k in frames:
            left, right = pairs.left[k - pairs.first], pairs.right[k - pairs.first]
            right = right[:, moved] if shift else right
            found = _find(full, left, right, stereo, checked=half is None)
            if half is not None:
                near = _find(half, halved(left), halved(right), stereo, checked=True)
                found = combined(found, near, at_full_size, count)
            # In the leftmost columns a large disparity points into the border, outside the image.
            outside = found > SUBPIXELS * (columns - max(shift, 0))
            if shift < 0:  # So does a small one in the rightmost columns.
                outside |= found < SUBPIXELS * (columns - (rig.width - 1 + shift))
            found[outside] = INVALID
            raw.append(corrected(found, errors, count) if errors.any() else found)
    # Images in memory are those of a single call, whose disparities nobody stores.
    make = Disparities.from_raw if isinstance(pairs.left, ImageStack) else Disparities.in_memory
    return make(frames.start, count, raw)


def _matcher(stereo: StereoParameters, count: int) -> Any:
    """OpenCV's matcher for `count` disparities from 0 px on: far obstacles have one near 0."""
    import cv2

    if stereo.kind == "sgm":
        return cv2.StereoSGBM_create(
            numDisparities=count,
            blockSize=stereo.block_size,
            P1=stereo.p1,
            P2=stereo.p2,
            preFilterCap=stereo.pre_filter_cap,
            speckleRange=stereo.speckle_range,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,  # The path cost has three directions.
        )
    matcher = cv2.StereoBM_create(numDisparities=count, blockSize=stereo.block_size)
    matcher.setPreFilterType(cv2.StereoBM_PREFILTER_XSOBEL)
    matcher.setPreFilterCap(stereo.pre_filter_cap)
    matcher.setTextureThreshold(stereo.texture_threshold)
    matcher.setSpeckleRange(stereo.speckle_range)
    return matcher


def _find(
    matcher: Any, left: np.ndarray, right: np.ndarray, stereo: MatchingParameters, checked: bool
) -> np.ndarray:
    """Raw disparity (H, W) int16 in 1/16 px of two grey images (H, W) uint8.

    Corrected as `stereo.subpixel` demands.
    """
    import cv2

    matcher.setDisp12MaxDiff(stereo.left_right_difference if checked else -1)
    matcher.setUniquenessRatio(stereo.uniqueness_ratio if checked else 0)
    matcher.setSpeckleWindowSize(stereo.speckle_window if checked else 0)
    # A matcher reports nothing in so many columns on the left: they are put there and cut off.
    border = matcher.getNumDisparities()
    if isinstance(matcher, cv2.StereoBM):
        border += matcher.getBlockSize() // 2
    widen = ((0, 0), (border, 0))
    raw = matcher.compute(np.pad(left, widen, mode="edge"), np.pad(right, widen, mode="edge"))
    found = np.where(raw[:, border:] < 0, np.int16(INVALID), raw[:, border:])
    return correct_phases(found) if stereo.subpixel == "phase_table" else found


def corrected(raw: np.ndarray, errors: np.ndarray, count: int) -> np.ndarray:
    """Raw disparities (H, W) int16 without the `errors` (W,) of their columns, in 1/16 px.

    Those that leave [0, `count`) px are invalid.
    """
    moved = raw - errors
    inside = (raw != INVALID) & (moved >= 0) & (moved < count * SUBPIXELS)
    return np.where(inside, moved, np.int16(INVALID)).astype(np.int16)


@contextmanager
def one_thread():
    """OpenCV on one thread: workers give the parallelism, the bytes must not depend on it."""
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


PHASE_TABLE = (0, 2, 4, 5, 6, 7, 7, 8, 8, 8, 9, 9, 10, 11, 12, 14)
"""True phase by matched phase, 1/16 px. `python bench/phase_table.py` prints it."""

NEAR = 4
"""A median that is farther from its pixel is of another surface, 1/16 px."""


def correct_phases(raw: np.ndarray) -> np.ndarray:
    """Raw disparity (H, W) int16 with the phases of `PHASE_TABLE`, and less noise.

    `raw` (H, W) int16 is in 1/16 px, negative without a match. True phases are even over a large
    area, matched phases are not, so their cumulated histogram is the correction. The median of
    5 × 5 px is taken only within `NEAR`, so that edges stay.
    """
    import cv2

    # OpenCV looks up bytes: the lowest one of a raw disparity has its phase.
    steps = np.array(PHASE_TABLE, dtype=np.int8) - np.arange(SUBPIXELS, dtype=np.int8)
    corrected = raw + cv2.LUT(raw.astype(np.uint8), np.tile(steps, 256 // SUBPIXELS))
    median = cv2.medianBlur(corrected, 5)
    near = (raw >= 0) & (median >= 0) & (np.abs(median - corrected) <= NEAR)
    np.copyto(corrected, median, where=near)
    # The phase of INVALID moved it, but it is still negative.
    return np.maximum(corrected, INVALID, out=corrected)


AGREE = 2
"""Disparities of both sizes that differ by at most this are of the same surface, px."""

HOLE = 5
"""A pixel without a match may be of the surface of one so many pixels away, at half the size."""


def halved(image: np.ndarray) -> np.ndarray:
    """A grey image (H, W) uint8 at half the size, (⌈H/2⌉, ⌈W/2⌉): means of 2 × 2 px."""
    import cv2

    height, width = image.shape
    even = cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
    return cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def combined(full: np.ndarray, half: np.ndarray, end: int, greatest: int) -> np.ndarray:
    """Raw disparity (H, W) int16 in 1/16 px of both sizes.

    Where both agree, that of the full size is taken: it is more precise. Where the half size has no
    match, its least or greatest one within `HOLE` may agree. Else that of the half size is doubled,
    if it is above `end` - `AGREE`: there the full size finds a wrong point or no point. Other
    pixels are invalid.

    Args:
        full: (H, W) int16, searched below `end` px. It needs no checks of its own.
        half: (⌈H/2⌉, ⌈W/2⌉) int16, searched everywhere and checked.
        greatest: disparities from here on are invalid, px.
    """
    import cv2

    # Where no match is near, one that, doubled, agrees with no disparity: too small, too large.
    small, large = np.int16(-AGREE * SUBPIXELS), np.int16(2**14 - 1)
    hole, window = half < 0, np.ones((2 * HOLE + 1, 2 * HOLE + 1), dtype=np.uint8)
    greatest_near = cv2.dilate(np.where(hole, small, half), window)
    least_near = cv2.erode(np.where(hole, large, half), window)
    agree = np.zeros(full.shape, dtype=bool)
    for found in (greatest_near, least_near):
        doubled = _doubled(np.where(hole, found, half), full.shape)
        agree |= np.abs(full - doubled) <= AGREE * SUBPIXELS
    agree &= full >= 0
    doubled = _doubled(half, full.shape)
    near = (doubled >= (end - AGREE) * SUBPIXELS) & (doubled < greatest * SUBPIXELS)
    return np.where(agree, full, np.where(near, doubled, np.int16(INVALID)))


def _doubled(half: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Disparities (⌈H/2⌉, ⌈W/2⌉) at half the size, at the full one (H, W): each for 2 × 2 px."""
    import cv2

    # INTER_NEAREST takes column u // 2.
    doubled = cv2.resize(2 * half, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST)
    return doubled[: shape[0], : shape[1]]
