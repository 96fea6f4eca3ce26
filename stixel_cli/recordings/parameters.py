"""Schemas of the group `source`: where the images come from."""

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters

_FRAMES = re.compile(r"(\d{1,7}):(\d{1,7})")


@parameters
class Rendered:
    """The images are rendered."""

    kind: Literal["rendered"]


@parameters(kw_only=True)
class Recorded:
    """A recording of a real stereo rig.

    Attributes:
        kind: the layout of its folder.
        folder: that folder.
        frames: numbers of the frames, `first:stop`; null for all that the recording has.
        sample_time: time from one frame to the next, s.
        correction: how `rig.disparity_offset` and `rig.disparity_slope` were estimated, in words
            that `stixel calibrate` prints; null if they were not.
    """

    kind: str
    folder: str | None
    frames: str | None
    sample_time: Annotated[float, Ge(0.001), Le(10)]
    correction: str | None = None

    def check(self) -> None:
        """Raise ValueError if a needed value is missing, or the frames are not a range."""
        if not self.folder:
            raise ValueError(f"source.folder: is required with source={self.kind}")
        chosen_frames(self.frames)


@dataclass(frozen=True, kw_only=True)
class KittiTracking(Recorded):
    """KITTI's tracking benchmark.

    Attributes:
        sequence: number of the clip, such as 0005.
        target: track id in the labels; `auto`: every moving object is tracked; null for no truth.
    """

    kind: Literal["kitti_tracking"]
    sequence: str | None
    target: Annotated[int, Ge(0)] | Literal["auto"] | None

    def check(self) -> None:
        """Raise ValueError if a needed value is missing or not valid."""
        super().check()
        if self.sequence is None:
            raise ValueError(f"source.sequence: is required with source={self.kind}")
        if not re.fullmatch(r"\d{1,4}", self.sequence):
            raise ValueError(
                f"source.sequence: must be a number such as 0005, got {self.sequence!r}"
            )


@dataclass(frozen=True, kw_only=True)
class PlainFolder(Recorded):
    """A folder with `rig.yaml`, the images in `left/` and `right/`, and optional truth.

    Attributes:
        target: track id in the labels; `auto`: every moving object is tracked; null for no truth.
    """

    kind: Literal["folder"]
    target: Annotated[int, Ge(0)] | Literal["auto"] | None


@dataclass(frozen=True, kw_only=True)
class KittiOdometry(Recorded):
    """KITTI's odometry benchmark, which has no labels.

    Attributes:
        target: `auto`: every moving object is tracked; null for the cluster at `start.bearing`.
    """

    kind: Literal["kitti_odometry"]
    target: Literal["auto"] | None


@dataclass(frozen=True, kw_only=True)
class KittiPair(Recorded):
    """One pair of KITTI's object, stereo 2012 or stereo 2015 benchmark.

    Attributes:
        sequence: number of the pair, such as 000123.
    """

    kind: Literal["kitti_pair"]
    sequence: str | None

    def check(self) -> None:
        """Raise ValueError if a needed value is missing or not valid."""
        super().check()
        if self.sequence is None or not re.fullmatch(r"\d{1,6}", self.sequence):
            raise ValueError(
                f"source.sequence: must be a number such as 000123, got {self.sequence!r}"
            )


@dataclass(frozen=True, kw_only=True)
class VirtualKitti(Recorded):
    """Virtual KITTI 2, one variation of a scene.

    Attributes:
        target: trackID in the labels; `auto`: every moving object is tracked; null for no truth.
    """

    kind: Literal["virtual_kitti"]
    target: Annotated[int, Ge(0)] | Literal["auto"] | None


@dataclass(frozen=True, kw_only=True)
class Argoverse(Recorded):
    """Argoverse 2's sensor data set, the stereo cameras of one log.

    Attributes:
        target: track_uuid in the labels; `auto`: every moving object is tracked; null for no truth.
    """

    kind: Literal["argoverse"]
    target: str | None


@dataclass(frozen=True, kw_only=True)
class Pair(Recorded):
    """One pair of images, each file named; `stixel assess` composes it.

    Attributes:
        folder: the left image.
        right: the right image.
        calibration: KITTI's calibration file, or a rig.yaml.
        disparity: the true disparities; null for none.
        labels: KITTI's labels; null for none.
    """

    kind: Literal["pair"]
    right: str | None
    calibration: str | None
    disparity: str | None
    labels: str | None

    def check(self) -> None:
        """Raise ValueError if a needed value is missing."""
        super().check()
        for name in ("right", "calibration"):
            if not getattr(self, name):
                raise ValueError(f"source.{name}: is required with source={self.kind}")


Source = (
    Rendered
    | KittiTracking
    | KittiOdometry
    | PlainFolder
    | KittiPair
    | VirtualKitti
    | Argoverse
    | Pair
)


def chosen_frames(text: str | None, key: str = "source.frames") -> range | None:
    """The frames that the setting `key` names; None for all.

    Raises:
        ValueError: unless it is `first:stop` with first < stop.
    """
    if text is None:
        return None
    match = _FRAMES.fullmatch(text)
    if match is None or int(match[1]) >= int(match[2]):
        raise ValueError(f"{key}: must be first:stop with first < stop, got {text!r}")
    return range(int(match[1]), int(match[2]))
