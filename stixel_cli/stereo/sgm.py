"""Semi-global matching, Hirschmüller 2008, in OpenCV's modes."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le, MultipleOf

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stereo.matching import BLOCK, MatchingParameters, match_pairs


@dataclass(frozen=True, kw_only=True)
class SgmParameters(MatchingParameters):
    """Semi-global matching, Hirschmüller 2008, as OpenCV's StereoSGBM; it filters by x-derivative.

    Attributes:
        subpixel: also "phase_table": by a table fitted to this matcher, and a median, in half of
            the time of "second_match".
        disparities_at_full_size: number of disparities searched on whole images, px, a multiple of
            16; null, or a number that is not below that of all disparities: all. Images of half the
            size then give the larger ones, and check the others. The check of left and right and
            the speckles are then in pixels of these images.
    """

    kind: Literal["sgm"]
    block_size: Annotated[int, Ge(1), Le(21)]
    subpixel: Literal["parabola", "phase_table", "second_match"]
    disparities_at_full_size: Annotated[int, Ge(BLOCK), Le(1024), MultipleOf(BLOCK)] | None = None

    pre_filter_cap: ClassVar[int] = 63
    p1: ClassVar[int] = 100
    """Penalty of a disparity change by one between neighbours."""
    p2: ClassVar[int] = 2400
    """Penalty of a greater change between neighbours."""


def match(pairs: StereoPairs, stereo: SgmParameters, rig: Rig, frames: range) -> Disparities:
    """Disparities of the left views of `frames`, 1/16 px, by semi-global matching on one thread.

    The left border keeps its disparities as far as the right image reaches: a point in column u
    with a disparity above u is outside the right image, so it is invalid.
    """
    import cv2

    def create(minimum: int, count: int) -> cv2.StereoSGBM:
        return cv2.StereoSGBM_create(
            minDisparity=minimum,
            numDisparities=count,
            blockSize=stereo.block_size,
            P1=stereo.p1,
            P2=stereo.p2,
            preFilterCap=stereo.pre_filter_cap,
            speckleRange=stereo.speckle_range,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,  # The path cost has three directions.
        )

    return match_pairs(
        pairs, frames, create, stereo, rig, at_full_size=stereo.disparities_at_full_size
    )
