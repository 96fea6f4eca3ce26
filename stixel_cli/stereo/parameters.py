"""What can be chosen about stereo matching; the defaults are in conf/stereo/."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, MultipleOf

from stixel_cli.geometry.rig import STRICT


@dataclass(frozen=True)
class SgmParameters:
    """Semi-global matching, Hirschmüller 2008, as OpenCV's StereoSGBM.

    Attributes:
        kind: "sgm".
        disparities: number of disparities searched, px, a multiple of 16; null: as many as an
            object `nearest` metres away needs with the rig at hand.
        nearest: least depth that must be measurable, m; read where `disparities` is null.
        minimum_disparity: the least disparity searched, px.
        mode: directions of the path cost: "sgbm" five, "hh" eight, "3way" three, "hh4" four.
        block_size: side of the matched block, px, odd.
        p1, p2: penalty of a disparity change by one, and by more, between neighbours; p2 > p1.
        left_right_difference: greatest difference of the left and the right view's disparity, px;
            -1: not checked.
        pre_filter_cap: bound of the x-derivative that is matched, grey levels.
        uniqueness_ratio: per cent by which the best cost must beat the others.
        speckle_window: smaller regions of even disparity are invalid, px²; 0: not filtered.
        speckle_range: greatest disparity step inside such a region, px.
        error_cancellation: match once more with the right image moved half a pixel and take the
            mean, which cancels most of the pull to whole pixels, in twice the time.
    """

    __pydantic_config__ = STRICT

    kind: Literal["sgm"]
    disparities: Annotated[int, Ge(16), Le(1024), MultipleOf(16)] | None
    nearest: Annotated[float, Gt(0), Le(100)]
    minimum_disparity: Annotated[int, Ge(0), Le(512)]
    mode: Literal["sgbm", "hh", "3way", "hh4"]
    block_size: Annotated[int, Ge(1), Le(21)]
    p1: Annotated[int, Ge(0), Le(100000)]
    p2: Annotated[int, Ge(0), Le(100000)]
    left_right_difference: Annotated[int, Ge(-1), Le(1024)]
    pre_filter_cap: Annotated[int, Ge(1), Le(63)]
    uniqueness_ratio: Annotated[int, Ge(0), Le(100)]
    speckle_window: Annotated[int, Ge(0), Le(10000)]
    speckle_range: Annotated[int, Ge(0), Le(64)]
    error_cancellation: bool

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        if self.block_size % 2 == 0:
            raise ValueError(f"stereo.block_size: {self.block_size} is even, it must be odd")
        if self.p2 <= self.p1:
            raise ValueError(f"stereo.p2: {self.p2} must be above stereo.p1, which is {self.p1}")


@dataclass(frozen=True)
class BmParameters:
    """Block matching, Konolige 1997, as OpenCV's StereoBM.

    Attributes:
        kind: "bm".
        disparities: number of disparities searched, px, a multiple of 16; null: as many as an
            object `nearest` metres away needs with the rig at hand.
        nearest: least depth that must be measurable, m; read where `disparities` is null.
        minimum_disparity: the least disparity searched, px.
        block_size: side of the matched block, px, odd, at most the image's sides.
        pre_filter: what is matched: "normalized_response" or "x_sobel".
        pre_filter_size: window of the normalised response, px, odd.
        pre_filter_cap: bound of the filtered image, grey levels.
        texture_threshold: blocks whose summed filter response is below it are invalid.
        left_right_difference: greatest difference of the left and the right view's disparity, px;
            -1: not checked.
        uniqueness_ratio: per cent by which the best cost must beat the others.
        speckle_window: smaller regions of even disparity are invalid, px²; 0: not filtered.
        speckle_range: greatest disparity step inside such a region, px.
        error_cancellation: match once more with the right image moved half a pixel and take the
            mean, which cancels most of the pull to whole pixels, in twice the time.
    """

    __pydantic_config__ = STRICT

    kind: Literal["bm"]
    disparities: Annotated[int, Ge(16), Le(1024), MultipleOf(16)] | None
    nearest: Annotated[float, Gt(0), Le(100)]
    minimum_disparity: Annotated[int, Ge(0), Le(512)]
    block_size: Annotated[int, Ge(5), Le(255)]
    pre_filter: Literal["normalized_response", "x_sobel"]
    pre_filter_size: Annotated[int, Ge(5), Le(255)]
    pre_filter_cap: Annotated[int, Ge(1), Le(63)]
    texture_threshold: Annotated[int, Ge(0), Le(100000)]
    left_right_difference: Annotated[int, Ge(-1), Le(1024)]
    uniqueness_ratio: Annotated[int, Ge(0), Le(100)]
    speckle_window: Annotated[int, Ge(0), Le(10000)]
    speckle_range: Annotated[int, Ge(0), Le(64)]
    error_cancellation: bool

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        for name in ("block_size", "pre_filter_size"):
            if getattr(self, name) % 2 == 0:
                raise ValueError(f"stereo.{name}: {getattr(self, name)} is even, it must be odd")


StereoParameters = SgmParameters | BmParameters
