"""Schemas of the group `source`: where the images come from."""

import re
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from stixel_cli.parameters import parameters

_FRAMES = re.compile(r"(\d{1,7}):(\d{1,7})")

CALIBRATIONS = ("motion", "none")
"""Values of `source.calibration` that name no file."""


@parameters
class Rendered:
    """The images are rendered."""

    kind: Literal["rendered"]


@parameters(kw_only=True)
class _InFolder:
    """A recording in one folder or file.

    Attributes:
        folder: path of it.
    """

    folder: str | None


@parameters(kw_only=True)
class Recorded:
    """A recording of a real stereo rig.

    Attributes:
        kind: the layout of its files.
        frames: numbers of the frames, `first:stop`; null for all that the recording has.
        sample_time: time from one frame to the next, s.
        calibration: of the rig's disparity error. `motion`: by the motion of its camera, unless the
            rig states it; `none`: as the rig states it; or a rig.yaml that states it.
        pose_scale: factor on the lengths of the ego poses; `estimated`: the length of the way by
            the images over theirs, for poses of odometry with a rig that has an error.
        check_rectification: whether to refuse images with a vertical disparity from 2 px on, or
            with left and right exchanged; otherwise one line warns, as from 0.5 px on.
    """

    kind: str
    frames: str | None
    sample_time: Annotated[float, Ge(0.001), Le(10)]
    calibration: str = "motion"
    pose_scale: Annotated[float, Ge(0.5), Le(2)] | Literal["estimated"] = 1.0
    check_rectification: bool = True

    required: ClassVar[tuple[str, ...]] = ("folder",)
    example: ClassVar[str] = ""
    """Of a sequence, with the most digits."""

    @property
    def by_motion(self) -> bool:
        """Whether the motion of the camera calibrates its rig."""
        return self.calibration == "motion"

    def check(self) -> None:
        """Raise ValueError if a required value is missing or not valid."""
        missing = [f"source.{name}" for name in self.required if not getattr(self, name)]
        if missing:
            others = f"; also {', '.join(missing[1:])}" if missing[1:] else ""
            raise ValueError(f"{missing[0]}: is required with source={self.kind}{others}")
        if self.example and not re.fullmatch(rf"\d{{1,{len(self.example)}}}", self.sequence):
            raise ValueError(
                f"source.sequence: must be a number such as {self.example}, got {self.sequence!r}"
            )
        chosen_frames(self.frames)


@dataclass(frozen=True, kw_only=True)
class LabelledFolder(Recorded, _InFolder):
    """A drive of KITTI's raw data, a variation of a scene of Virtual KITTI 2, or a plain folder.

    Attributes:
        target: track id in the labels; `auto`: every moving object is tracked; null for no truth.
    """

    kind: Literal["kitti_raw", "virtual_kitti", "folder"]
    target: Annotated[int, Ge(0)] | Literal["auto"] | None


@dataclass(frozen=True, kw_only=True)
class KittiTracking(LabelledFolder):
    """KITTI's tracking benchmark.

    Attributes:
        sequence: number of the clip, such as 0005.
    """

    kind: Literal["kitti_tracking"]
    sequence: str | None

    required = ("folder", "sequence")
    example = "0005"


@dataclass(frozen=True, kw_only=True)
class KittiOdometry(Recorded, _InFolder):
    """KITTI's odometry benchmark, which has no labels.

    Attributes:
        target: `auto`: every moving object is tracked; null for the cluster at `start.bearing`.
    """

    kind: Literal["kitti_odometry"]
    target: Literal["auto"] | None


@dataclass(frozen=True, kw_only=True)
class Argoverse(Recorded, _InFolder):
    """Argoverse 2's sensor data set, the stereo cameras of one log.

    Attributes:
        target: track_uuid in the labels; `auto`: every moving object is tracked; null for no truth.
    """

    kind: Literal["argoverse"]
    target: str | None


@dataclass(frozen=True, kw_only=True)
class Rosbag(Recorded, _InFolder):
    """A bag of ROS 1 or ROS 2; `folder` may be a file, too.

    Attributes:
        target: `auto`: every moving object is tracked; null for the cluster at `start.bearing`.
        left_topic: of rectified images, with `camera_info` beside it.
        right_topic: of those of the other camera.
        odometry_topic: of `nav_msgs/Odometry` of the ego car; null without its poses.
    """

    kind: Literal["rosbag"]
    target: Literal["auto"] | None
    left_topic: str
    right_topic: str
    odometry_topic: str | None


@dataclass(frozen=True, kw_only=True)
class KittiPair(Recorded, _InFolder):
    """One pair of KITTI's object, stereo 2012 or stereo 2015 benchmark.

    Attributes:
        sequence: number of the pair, such as 000123.
    """

    kind: Literal["kitti_pair"]
    sequence: str | None

    required = ("folder", "sequence")
    example = "000123"


@dataclass(frozen=True, kw_only=True)
class Pair(Recorded):
    """One pair of images, each file named; `stixel stixels` and `stixel assess` compose it.

    Attributes:
        left: the left image.
        right: the right image.
        calibration: a file of KITTI, Middlebury, ROS or OpenCV, or a rig.yaml.
        disparity: the true disparities; null for none.
        labels: KITTI's labels; null for none.
    """

    kind: Literal["pair"]
    left: str | None
    right: str | None
    calibration: str | None
    disparity: str | None
    labels: str | None

    required = ("left", "right", "calibration")


Folders = KittiTracking | LabelledFolder | KittiOdometry | KittiPair | Argoverse | Rosbag
Source = Rendered | Folders | Pair


def chosen_frames(text: str | None, key: str = "source.frames") -> range | None:
    """The frames that the setting `key` names; None for all.

    ValueError unless it is `first:stop` with first < stop.
    """
    if text is None:
        return None
    match = _FRAMES.fullmatch(text)
    if match is None or int(match[1]) >= int(match[2]):
        raise ValueError(f"{key}: must be first:stop with first < stop, got {text!r}")
    return range(int(match[1]), int(match[2]))
