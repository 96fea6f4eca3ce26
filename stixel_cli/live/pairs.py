"""Stixels of your own images or disparities in one call: `stixels_from_pair`.

The parameters are those of `stixel run source=pair …`: the road is estimated. To import this takes
NumPy only; Hydra, Open3D and the engine are never imported.
"""

import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.config.annotations import first_fault, read_as
from stixel_cli.config.folders import real_image_parameters
from stixel_cli.errors import ArgumentError, UserError, located
from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.geometry.rig import Rig
from stixel_cli.stixels.types import FreeSpace, Stixels

if TYPE_CHECKING:
    import pandas

    from stixel_cli.measurements.scans import Scans
    from stixel_cli.rendering.frames import StereoPairs
    from stixel_cli.stereo.disparities import Disparities

RigLike = Rig | Mapping[str, float] | Path | str
"""A rig: numbers, the name of a file that `recordings.rig_files` reads, or a `Rig`."""

FRAME = range(1, 2)
"""Index of the frame; the one before it is that of `previous`."""

PARKED = np.array([[0.0, 0.0, STRAIGHT_AHEAD]] * 2)

UNITS = {"int16": 16, "uint16": 256}
"""Units of integer disparities per px: of OpenCV's matchers, and of KITTI's files."""

LEFT_OUT = ("horizontal_fov", "focal_length", "principal_u", "principal_v", "vertical_fov")
"""Fields of a rig that numbers may leave out, as well as the pitch."""


@dataclass(frozen=True, repr=False, eq=False)
class FrameStixels:
    """The n stixels of one frame, from left to right, and its free space.

    Attributes:
        rig: of the images, W × H px.
        stixels: of this frame, as the stage `stixels` of a run has them, with further arrays.
        free_space: of this frame; the unknown part of a column begins at its `unknown_row`.
        image: (H, W) uint8, the left image; None without images.
        columns: (n, 2) int32 px, the first column and the one after the last.
        rows: (n, 2) int32 px, top and base, both inclusive.
        depth: (n,) m along the road, straight ahead of the left camera; and variance: its, (n,) m².
        height: (n,) m, of the top above the road.
        points: (n, 2) m on the ground, to the right of the left camera and ahead of it.
        unknown: (W,) bool, columns of which a part is unknown: it may hide an obstacle.
    """

    rig: Rig
    stixels: Stixels
    free_space: FreeSpace
    image: np.ndarray | None = None

    def __post_init__(self) -> None:
        own = self.stixels
        vars(self).update(
            columns=np.stack([own.left, own.right], axis=1),
            rows=np.stack([own.top, own.base], axis=1),
            depth=own.depth,
            variance=own.covariances_ego[:, 1, 1],
            height=own.height,
            points=own.points_ego,
            unknown=self.free_space.unknown_row[0] >= 0,
        )

    def __len__(self) -> int:
        return len(self.stixels.left)

    def to_frame(self) -> "pandas.DataFrame":
        """A table with one row per stixel; `stixel assess --stixels` reads it as CSV.

        Its columns are those of `results.tables.stixel_columns`, without k.
        """
        import pandas

        from stixel_cli.results.tables import stixel_columns

        return pandas.DataFrame(stixel_columns([self.stixels])).drop(columns="k")

    def to_scan(self, pose: np.ndarray = (0.0, 0.0, STRAIGHT_AHEAD), time: float = 0.0) -> "Scans":
        """One scan for a tracker: the ground points inside the gates of height and range.

        `pose` (3,) is that of the camera in the world: x m, y m, heading rad. `time` is in s.
        """
        from stixel_cli.measurements.stixels import gather_scans
        from stixel_cli.scene.scenario import EgoMotion

        motion = EgoMotion(np.array([time]), np.array([pose], dtype=np.float64))
        return gather_scans([self.stixels], motion, real_image_parameters().measurement, self.rig)

    def to_stx1(self) -> bytes:
        """The content of a `.stx1` file, with the left image if there is one.

        UserError without pyStixel-lib, `pip install 'stixel[stx1]'`.
        """
        from stixel_cli.export.stx1 import stixel_world
        from stixel_cli.rendering.images import encode_png
        from stixel_cli.validation.stixel_file import stx1_library

        nothing = np.zeros(len(self), dtype=bool)
        world = stixel_world(stx1_library("to_stx1"), self.stixels, 0, nothing, self.rig, "car")
        if self.image is not None:
            world.image = encode_png(self.image)
        return world.SerializeToString()

    def draw(self, image: np.ndarray | None = None) -> np.ndarray:
        """A picture (H, W, 3) uint8 RGB: the stixels over the image, near yellow, far violet.

        `image` is (H, W) or (H, W, 3) uint8, by default the left image, or black without one.
        """
        from stixel_cli.pictures.camera import painted
        from stixel_cli.pictures.style import depth_colours

        image = self.image if image is None else image
        if image is None:
            image = np.zeros((self.rig.height, self.rig.width), dtype=np.uint8)
        return painted(image, self.stixels, depth_colours(self.depth))

    def __repr__(self) -> str:
        span = f", {self.depth.min():.1f} to {self.depth.max():.1f} m" if len(self) else ""
        unknown = f"{self.unknown.sum()} of {self.rig.width} columns with an unknown part"
        return f"<{len(self)} stixels{span}; {unknown}>"

    def _repr_png_(self) -> bytes:
        from stixel_cli.rendering.images import encode_png

        return encode_png(self.draw())


def stixels_from_pair(
    left: np.ndarray,
    right: np.ndarray,
    rig: RigLike,
    *,
    previous: FrameStixels | None = None,
    check_rectification: bool = True,
) -> FrameStixels:
    """The stixels of a rectified pair of images.

    Args:
        left, right: (H, W) grey, (H, W, 3) RGB or (H, W, 4) RGBA images, uint8; uint16, of which
            the greatest value of both becomes 255; or float in [0, 1] or [0, 255]. Colour becomes
            luma (ITU-R BT.601).
        rig: the cameras. Numbers are `focal_length` (px), `baseline` and `camera_height` (m), and
            as needed the other fields of `geometry.rig.Rig`, or `fx`, `fy`, `cx`, `cy`, or `K`
            (3, 3); the size is that of the images. A height that is not given is that of the road
            in the images.
        previous: stixels of the frame before, if the car is parked: the free space changes little
            from frame to frame. `StixelStream` does this for a car that drives.
        check_rectification: whether to refuse a pair with a vertical disparity from 2 px on, or
            with left and right exchanged; otherwise a warning is given, as from 0.5 px on.

    Raises:
        ArgumentError: a ValueError, for an argument that is not valid; it names the argument.
    """
    pair = grey_pair(left, right)
    shape = pair.left[0].shape
    matching = rig_of(rig, shape)
    check_rows(pair, matching, check_rectification)
    disparities = matched(pair, matching)
    return stixels_of(disparities, pair, rig_of(rig, shape, disparities), previous)


def stixels_from_disparity(
    disparity: np.ndarray,
    rig: RigLike,
    *,
    images: tuple[np.ndarray, np.ndarray] | None = None,
    previous: FrameStixels | None = None,
    scale: float | None = None,
) -> FrameStixels:
    """The stixels of a disparity image.

    Args:
        disparity: (H, W), column in the left image minus that in the right one, without the error
            that `rig` states: float, px; int16, 1/16 px, as OpenCV's matchers have it; or uint16,
            1/256 px, as KITTI's files. Unknown where it is NaN, infinite, 0 or negative. It is
            rounded to 1/16 px. Disparities of depths below `stereo.nearest`, 2 m, count as unknown.
        rig, previous: as in `stixels_from_pair`.
        images: the left and the right image, which refine the disparity of each stixel; without
            them it is not refined.
        scale: px per unit of `disparity`, of any type; without it, a warning names the unit in
            which integers are read.

    Raises:
        ArgumentError: as in `stixels_from_pair`.

    Example:
        >>> rows = np.arange(200.0)[:, None] - 100.0  # px below the horizon
        >>> road = np.where(rows > 0.0, rows * 0.5 / 1.5, 0.0) * np.ones(300)
        >>> road[60:130, 100:140] = 10.0  # an upright face, 500 px · 0.5 m / 10 px = 25 m away
        >>> rig = {"focal_length": 500.0, "baseline": 0.5, "camera_height": 1.5}
        >>> table = stixels_from_disparity(road, rig).to_frame()
        >>> round(float(table.query("100 <= left and right <= 140")["depth"].median()), 1)
        25.0
    """
    from stixel_cli.stereo.disparities import INVALID, SUBPIXELS, Disparities
    from stixel_cli.stereo.matching import disparity_count

    disparity = np.asarray(disparity)
    kind, shape = str(disparity.dtype), disparity.shape
    if disparity.ndim != 2 or (kind not in UNITS and disparity.dtype.kind != "f"):
        raise ArgumentError(f"disparity: must be float, int16 or uint16 (H, W), got {kind} {shape}")
    if scale is None and kind in UNITS:
        unit = f"1/{UNITS[kind]} px"
        warnings.warn(
            f"disparity: {kind} is read in units of {unit}; else give scale", stacklevel=2
        )
    scale = 1.0 / UNITS.get(kind, 1) if scale is None else scale
    if not 0.0 < scale < 1e6:
        raise ArgumentError(f"scale: must be > 0 and < 1e6 px per unit, got {scale:g}")
    matching = rig_of(rig, shape)
    pair = None if images is None else grey_pair(*images)
    if pair is not None and pair.left[0].shape != shape:
        raise ArgumentError(f"images: must be {shape} px, got {pair.left[0].shape}")
    count = disparity_count(real_image_parameters().stereo, matching)
    known = (disparity > 0) & np.isfinite(disparity)
    pixels = scale * np.where(known, disparity, 0).astype(np.float64) - matching.far_disparity
    scaled = np.rint(SUBPIXELS * pixels)
    known &= (scaled >= 0) & (scaled < SUBPIXELS * count)
    raw = np.where(known, scaled, INVALID).astype(np.int16)
    disparities = Disparities.in_memory(FRAME.start, count, [raw])
    return stixels_of(disparities, pair, rig_of(rig, shape, disparities), previous)


def check_rows(pair: "StereoPairs", rig: Rig, check_rectification: bool) -> bool:
    """Warn of a fault of a grey pair, or raise ArgumentError; whether it has enough corners."""
    from stixel_cli.stereo.rectification import compare_rows

    rows = compare_rows(pair.left[0], pair.right[0], rig.far_disparity)
    if rows and rows.refused and check_rectification:
        raise ArgumentError(f"right: {rows.fault}; or pass check_rectification=False")
    if rows and rows.fault:
        warnings.warn(rows.fault, stacklevel=3)
    return rows is not None


def matched(pair: "StereoPairs", rig: Rig) -> "Disparities":
    """Disparities of a pair of grey images, by semi-global matching on one thread."""
    from stixel_cli.stereo.matching import match

    return match(pair, real_image_parameters().stereo, rig, FRAME)


def stixels_of(
    disparities: "Disparities",
    pair: "StereoPairs | None",
    rig: Rig,
    previous: FrameStixels | None,
    poses: np.ndarray = PARKED,
) -> FrameStixels:
    """Stixels from disparities; `poses` (2, 3) of the car in the world: the frame before, and now.

    Without a `pair` of images the disparities are not refined.
    """
    from stixel_cli.scene.scenario import EgoMotion
    from stixel_cli.stixels.extraction import extract_stixels
    from stixel_cli.stixels.free_space import find_free_space

    p, motion = real_image_parameters(), EgoMotion(np.arange(2.0), poses)
    before = None if previous is None else previous.free_space
    free_space = find_free_space(
        disparities, motion, rig, p.road, p.occupancy, p.free_space, FRAME, before
    )
    extraction = p.extraction if pair else replace(p.extraction, refinement=0.0)
    stixels = extract_stixels(disparities, free_space, pair, rig, p.height, extraction, FRAME)
    image = pair.left[0] if pair else None
    return FrameStixels(rig, replace(stixels, first=0), replace(free_space, first=0), image)


def grey_pair(*images: np.ndarray) -> "StereoPairs":
    """Both images as grey values (H, W) uint8, of `FRAME`; ArgumentError if they are not a pair."""
    import cv2

    from stixel_cli.rendering.frames import StereoPairs
    from stixel_cli.rendering.images import eight_bits

    if len(images) != 2:
        raise ArgumentError(f"images: must be the left and the right image, got {len(images)}")
    with located("", ArgumentError):
        plain = eight_bits({"left": np.asarray(images[0]), "right": np.asarray(images[1])})
    left, right = (i if i.ndim == 2 else cv2.cvtColor(i, cv2.COLOR_RGB2GRAY) for i in plain)
    if left.shape != right.shape:
        raise ArgumentError(f"right: must be {left.shape} px, as left, got {right.shape}")
    return StereoPairs(FRAME.start, (left,), (right,))


def rig_of(rig: RigLike, shape: tuple[int, int], disparities: "Disparities | None" = None) -> Rig:
    """The rig of images of `shape` (H, W); ArgumentError if it is not valid, or of another size.

    A height that it does not state is that of the road in `disparities`; without them, any height.
    """
    from pydantic import ValidationError

    from stixel_cli.recordings.rig_files import counterpart, our_names, read_named_calibration
    from stixel_cli.recordings.types import vertical_angle
    from stixel_cli.stixels.road import MIDDLE, NO_ROAD, seen_road

    size = {"width": shape[1], "height": shape[0]}
    try:
        if isinstance(rig, Path | str):
            given = read_named_calibration(Path(rig)).rig_values(**size)
        else:
            given = asdict(rig) if isinstance(rig, Rig) else our_names(dict(rig))
            if "focal_length_v" in given:
                focal_v, focal = given.pop("focal_length_v"), given.get("focal_length")
                given["vertical_fov"] = vertical_angle(focal or focal_v, focal_v, shape[0])
        absent = {"pitch": 0.0, "camera_height": MIDDLE}
        values = dict.fromkeys(LEFT_OUT) | absent | size | given
        plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in values.items()}
        if not size.items() <= plain.items():
            is_of, has = (f"{one['width']} × {one['height']} px" for one in (plain, size))
            raise ValueError(f"is of {is_of}, but the image has {has}")
        valid = read_as(Rig, plain)
        real_image_parameters().stereo.check(valid)
    except ValidationError as error:
        name, text, unknown = first_fault(error)
        meant = counterpart(name, [field.name for field in fields(Rig)]) if unknown else ""
        raise ArgumentError(f"rig: {name}: {text}{meant}") from None
    except (TypeError, ValueError, UserError) as fault:
        raise ArgumentError(f"rig: {fault}".replace("rig: rig.", "rig: ")) from None
    if disparities is None or "camera_height" in given:
        return valid
    seen = seen_road(disparities, valid)
    if seen is None:
        check = "Check first that the two images are one pair, of this rig"
        raise ArgumentError(
            f"rig: camera_height: is required, m above the road: {NO_ROAD}. {check}"
        )
    return replace(valid, camera_height=round(seen[1], 2))
