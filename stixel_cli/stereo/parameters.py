"""What can be chosen about stereo matching; the defaults are in conf/stereo/."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, MultipleOf

from stixel_cli.geometry.rig import STRICT


@dataclass(frozen=True, kw_only=True)
class _Matching:
    """What both matchers have.

    Attributes:
        kind: which matcher it is.
        disparities: number of disparities searched, px, a multiple of 16; null: as many as an
            object `nearest` metres away needs with the rig at hand.
        nearest: least depth that must be measurable, m; read where `disparities` is null.
        minimum_disparity: the least disparity searched, px.
        block_size: side of the matched block, px, odd, below the image's sides.
        left_right_difference: greatest difference of the left and the right view's disparity, px;
            -1: not checked.
        pre_filter_cap: bound of the filtered image that is matched, grey levels.
        uniqueness_ratio: per cent by which the best cost must beat the others.
        speckle_window: smaller regions of even disparity are invalid, px²; 0: not filtered.
        speckle_range: greatest disparity step inside such a region, px.
        error_cancellation: match once more with the right image moved half a pixel and take the
            mean, which cancels most of the pull to whole pixels, in twice the time.
    """

    __pydantic_config__ = STRICT

    kind: str
    disparities: Annotated[int, Ge(16), Le(1024), MultipleOf(16)] | None
    nearest: Annotated[float, Gt(0), Le(100)]
    minimum_disparity: Annotated[int, Ge(0), Le(512)]
    block_size: int
    left_right_difference: Annotated[int, Ge(-1), Le(1024)]
    pre_filter_cap: Annotated[int, Ge(1), Le(63)]
    uniqueness_ratio: Annotated[int, Ge(0), Le(100)]
    speckle_window: Annotated[int, Ge(0), Le(10000)]
    speckle_range: Annotated[int, Ge(0), Le(64)]
    error_cancellation: bool

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        _check_odd("block_size", self.block_size)


@dataclass(frozen=True, kw_only=True)
class SgmParameters(_Matching):
    """Semi-global matching, Hirschmüller 2008, as OpenCV's StereoSGBM; it filters by x-derivative.

    Attributes:
        mode: directions of the path cost: "sgbm" five, "hh" eight, "3way" three, "hh4" four.
        p1, p2: penalty of a disparity change by one, and by more, between neighbours; p2 > p1.
    """

    kind: Literal["sgm"]
    mode: Literal["sgbm", "hh", "3way", "hh4"]
    block_size: Annotated[int, Ge(1), Le(21)]
    p1: Annotated[int, Ge(0), Le(100000)]
    p2: Annotated[int, Ge(0), Le(100000)]

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        super().check()
        if self.p2 <= self.p1:
            raise ValueError(f"stereo.p2: {self.p2} must be above stereo.p1, which is {self.p1}")


@dataclass(frozen=True, kw_only=True)
class BmParameters(_Matching):
    """Block matching, Konolige 1997, as OpenCV's StereoBM.

    Attributes:
        pre_filter: what is matched: "normalized_response" or "x_sobel".
        pre_filter_size: window of the normalised response, px, odd.
        texture_threshold: blocks whose summed filter response is below it are invalid.
    """

    kind: Literal["bm"]
    block_size: Annotated[int, Ge(5), Le(255)]
    pre_filter: Literal["normalized_response", "x_sobel"]
    pre_filter_size: Annotated[int, Ge(5), Le(255)]
    texture_threshold: Annotated[int, Ge(0), Le(100000)]

    def check(self) -> None:
        """Raise ValueError where the parameters do not fit together."""
        super().check()
        _check_odd("pre_filter_size", self.pre_filter_size)


StereoParameters = SgmParameters | BmParameters


def _check_odd(name: str, value: int) -> None:
    if value % 2 == 0:
        raise ValueError(f"stereo.{name}: {value} is even, it must be odd")
