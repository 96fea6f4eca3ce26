"""Block matching, Konolige 1997, by OpenCV."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import StereoPairs
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stereo.matching import MatchingParameters, match_pairs


@dataclass(frozen=True, kw_only=True)
class BmParameters(MatchingParameters):
    """Block matching, Konolige 1997, as OpenCV's StereoBM; it filters by x-derivative."""

    kind: Literal["bm"]
    block_size: Annotated[int, Ge(5), Le(255)]
    subpixel: Literal["parabola", "second_match"]

    pre_filter_cap: ClassVar[int] = 31
    texture_threshold: ClassVar[int] = 10
    """Blocks whose summed filter response is below it are invalid: OpenCV's own value."""


def match(pairs: StereoPairs, stereo: BmParameters, rig: Rig, frames: range) -> Disparities:
    """Disparities of the left views of `frames`, 1/16 px, by block matching on one thread.

    The left border is kept as in semi-global matching; half a block is lost at the other three.

    Raises:
        ValueError: if the block is larger than the image.
    """
    import cv2

    if stereo.block_size > min(rig.width, rig.height):
        raise ValueError(f"stereo.block_size: {stereo.block_size} px is larger than the image")

    def create(minimum: int, count: int) -> cv2.StereoBM:
        matcher = cv2.StereoBM_create(numDisparities=count, blockSize=stereo.block_size)
        matcher.setMinDisparity(minimum)
        matcher.setPreFilterType(cv2.StereoBM_PREFILTER_XSOBEL)
        matcher.setPreFilterCap(stereo.pre_filter_cap)
        matcher.setTextureThreshold(stereo.texture_threshold)
        matcher.setSpeckleRange(stereo.speckle_range)
        return matcher

    return match_pairs(pairs, frames, create, stereo, rig)
