"""The files, the calibration and the labels of a recording."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE
from stixel_cli.scene.scenario import Scenario

ERROR_VALUES = ("disparity_error", "disparity_error_std")
"""Values of a rig on the error of its disparities: three numbers each, px, optional in files."""


@dataclass(frozen=True)
class Calibration:
    """A rectified stereo rig, as a recording's files state it.

    Attributes:
        focal_length: horizontal, px; and focal_length_v: vertical, px.
        principal_u, principal_v: principal point of the left camera, px.
        baseline: distance of the cameras, m.
        camera_height: above the road, m; None if the files do not state it.
        principal_u_right: of the right camera, px; None if it is that of the left.
        disparity_error, disparity_error_std: as those of `Rig`; () if the files do not state them.
        left_camera: its place in the frame of the labels, see `Tables`.
        rectification: of the images; None if the files are rectified.
    """

    focal_length: float
    focal_length_v: float
    principal_u: float
    principal_v: float
    baseline: float
    camera_height: float | None
    principal_u_right: float | None = None
    left_camera: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rectification: "Rectification | None" = None
    disparity_error: tuple[float, ...] = ()
    disparity_error_std: tuple[float, ...] = ()

    @property
    def error_values(self) -> dict[str, Any]:
        """The values of a `Rig`, by name, on its disparity error that the files state."""
        stated = {name: getattr(self, name) for name in ERROR_VALUES}
        return {name: list(values) for name, values in stated.items() if values}

    def rig_values(self, width: int, height: int) -> dict[str, Any]:
        """The values of a `Rig`, by name, that this and images of `width` × `height` px give."""
        camera_height = {} if self.camera_height is None else {"camera_height": self.camera_height}
        return {
            "width": width,
            "height": height,
            "horizontal_fov": None,
            "focal_length": self.focal_length,
            "principal_u": self.principal_u,
            "principal_v": self.principal_v,
            "principal_u_right": self.principal_u_right,
            "baseline": self.baseline,
            "vertical_fov": vertical_angle(self.focal_length, self.focal_length_v, height),
            "pitch": 0.0,
            **camera_height,
            **self.error_values,
        }


def vertical_angle(focal_length: float, focal_length_v: float, height: int) -> float | None:
    """The field of view over `height` px, degrees; None if both focal lengths, px, are the same.

    ValueError unless `focal_length_v` is positive.
    """
    if not focal_length_v > 0.0:
        raise ValueError(f"focal_length_v: must be > 0, got {focal_length_v:g}")
    if math.isclose(focal_length, focal_length_v, rel_tol=1e-6):
        return None
    return 2.0 * math.degrees(math.atan(height / (2.0 * focal_length_v)))


@dataclass(frozen=True)
class Rectification:
    """How the images of two cameras become a rectified pair."""

    left: tuple[float, ...]
    right: tuple[float, ...]
    """`left`, `right`: homographies from the pixels of a file to those of the pair, row by row."""
    size: tuple[int, int]
    """Width and height of the pair, px."""
    file_size: tuple[int, int]
    """Of the files."""


@dataclass(frozen=True)
class Tables:
    """How the tables of a recording, its ego poses and its labels, are written."""

    kind: str = "kitti"
    """`kitti`, or another one that `tables` reads."""
    times: tuple[int, ...] = ()
    """Time stamps of all left images of the clip, ns, where files name times and not frames; else
    ()."""
    first: int = 0
    """Number of the recording's first frame."""
    left_camera: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """(x, y, z) m, the left camera's place in the frame of the labels, whose axes are the camera's
    (x right, y down, z forward)."""
    topics: tuple[str, ...] = ()
    """Those of a bag that have the poses; else ()."""


Messages = tuple[tuple[str, tuple[int, ...]], ...]
"""Images in a bag: of the left and of the right camera, topic and times of recording in ns."""


@dataclass(frozen=True)
class Recording:
    """The files of a stretch of frames, and the calibration of the cameras."""

    layout: str
    """The option of the group `source`."""
    frames: range
    """Numbers of the frames in the files, without gaps."""
    tables: Tables
    """How the files of the ego poses and the labels are written."""
    calibration: Calibration | None = None
    """Of the rig; None if only its motion is replayed."""
    left: tuple[Path, ...] = ()
    right: tuple[Path, ...] = ()
    """`left`, `right`: one image file per frame; () if only its motion is replayed. Of a bag,
    `left` has its files."""
    width: int = 0
    height: int = 0
    """`width`, `height`: of the rectified images, px."""
    pose_files: tuple[Path, ...] = ()
    """Files of the ego poses; () without."""
    label_files: tuple[Path, ...] = ()
    """Files of the labels; () without."""
    target: int | str | None = None
    """Track id in the labels; None for no truth."""
    auto: bool = False
    """Whether every moving object is tracked."""
    label: str | None = None
    """Type of the target's label, such as `Car`; None without target."""
    first_box: tuple[float, float] | None = None
    """Left and right border, px, of the target's box in the first image, or None."""
    true_disparities: tuple[Path, ...] = ()
    """One file per frame of the left images' true disparities; () without."""
    messages: Messages = ()
    """The images, if they are in a bag."""

    @property
    def road_user(self) -> str | None:
        """The class of the target's label; None without target, or without a class."""
        return CLASS_OF_KITTI_TYPE.get(self.label or "")

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self.frames)

    @property
    def first_bearings(self) -> tuple[float, ...]:
        """Lowest and highest bearing of `first_box`, degrees, positive to the left; () without."""
        calibration = self.calibration
        return tuple(
            math.degrees(math.atan((calibration.principal_u - u) / calibration.focal_length))
            for u in reversed(self.first_box or ())
        )

    @property
    def images(self) -> tuple[Path, ...]:
        """The left images, then the right ones."""
        return self.left + self.right

    @property
    def truth_files(self) -> tuple[Path, ...]:
        """The files of the labels; empty without target."""
        return () if self.target is None else self.label_files


@dataclass(frozen=True)
class Labels:
    """The labels of one target, one row a frame in which it is labelled."""

    frames: np.ndarray
    """(n,) int64, increasing."""
    boxes: np.ndarray
    """(n, 4) px: left, top, right, bottom in the left image."""
    sizes: np.ndarray
    """(n, 3) m: height, width, length."""
    places: np.ndarray
    """(n, 3) m: centre of the box's bottom in the frame of the labels."""
    yaws: np.ndarray
    """(n,) rad about the y axis (down), 0 along x: `rotation_y` of KITTI."""
    truncated: np.ndarray
    occluded: np.ndarray
    """`truncated`, `occluded`: (n,) int64: 0 for not at all."""
    kind: str
    """The label's type, such as `Car`."""


Tracks = dict[int | str, Labels]
"""The labels of each target by its track id."""


@dataclass(frozen=True)
class LabelTruth:
    """The truth of one label."""

    name: str
    """Its track id in the files."""
    road_user: str
    """The class of its type; "other" for a type without a class."""
    scenario: Scenario
    """With this label as the target."""
