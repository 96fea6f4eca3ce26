"""What is known of a class of road users: its mean outline, and what a sensor sees of it.

The numbers are in `class_shapes.json`, which is generated. They differ from the prior's rectangle
or ellipse in two ways. The outline is the class's own. And it comes with *seen* shapes, one each
for stixels, for lidars and for a sensor that measures the outline itself: for every aspect and
offset of a ray (see `ray_table.py`), how far behind the outline a point is measured, and where the
sensor sees the road user begin and end. Thin parts at the edge, such as a wheel seen from the front
or a hand, are no obstacle of their column of the image, so a stixel shows what is behind them; a
lidar's beams miss them.

Frame: target, x along the heading, y left; m and rad.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from stixel_cli.tracking.contour.class_size import CLASS_SHAPES
from stixel_cli.tracking.contour.ray_table import TABLE, RayTable, outline_table
from stixel_cli.tracking.contour.user_shape import read_class

MODES, LIMB_MODES, MODE_ANGLES = 12, 6, 120
"""Modes of the outline, those of moving limbs, and the even angles at which they are given."""

HEIGHTS = 0.35 + 0.1 * np.arange(16)
"""Above the road, m, at which it is known how far a class's faces are inside its outline."""

NODES = (24, 9)
"""Even aspects over a full turn, and even offsets over the table's width, of the visible shape."""


@dataclass(frozen=True)
class ClassShape:
    """The outlines of a class."""

    outline: np.ndarray
    """(N, 2) m, the mean outline: counter-clockwise, at even angles from the heading on."""
    outline_stds: np.ndarray
    """(N,) m, standard deviation of the radius of the class's outlines, scaled to one box."""
    size: np.ndarray
    """(2,) m, length and width of this box, which contains the limbs in all poses. The outline may
    be smaller; it is scaled with the box."""


@dataclass(frozen=True)
class OutlineModes:
    """How the outlines of a class differ from its mean outline, scaled to one box.

    Each mode is the change of the radius, m, by one standard deviation, independent of the others.
    """

    fixed: np.ndarray
    """(12, 120), by which road users differ from each other."""
    limbs: np.ndarray
    """(6, 120), by which one road user changes as it moves."""

    @property
    def radius_stds(self) -> np.ndarray:
        """Standard deviation (120,) m of the radius."""
        return np.sqrt((self.fixed**2).sum(axis=0) + (self.limbs**2).sum(axis=0))


@dataclass(frozen=True)
class VisibleShape:
    """What a kind of sensor sees of a class."""

    depth_biases: np.ndarray
    """(24, 9) m, how far behind the outline a point is measured, by aspect and offset."""
    bias_per_std: float
    """The same, in standard deviations of the point's range: added to it."""
    depth_stds: np.ndarray
    """(24, 9) m, standard deviation of that distance beyond the point's own."""
    std_factor: float
    """Factor on the point's own standard deviation."""
    insets: np.ndarray
    """(2, 24) m, how far inside the outline the visible shape begins (low) and ends (high)."""
    inset_stds: np.ndarray
    """(2, 24) m."""


def known_class(road_user: str) -> dict[str, Any]:
    """What is known of a class: one of ours, or of the file of `prior.road_user`."""
    return CLASS_SHAPES.get(road_user) or read_class(Path(road_user))


def class_shape(road_user: str) -> ClassShape:
    """The outlines of `road_user`, a class of ours or the path of a class file."""
    known = known_class(road_user)
    radii = _metres(known["radii"])
    angles = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    stds = outline_modes(road_user).radius_stds
    return ClassShape(
        outline=radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1),
        outline_stds=np.interp(
            angles, angles[:: len(angles) // MODE_ANGLES], stds, period=2.0 * np.pi
        ),
        size=_metres(known["size"]),
    )


def outline_modes(road_user: str) -> OutlineModes:
    """How the outlines of `road_user` differ, a class of ours or the path of a class file."""
    known = known_class(road_user)
    return OutlineModes(
        *(_metres(known[name]).reshape(-1, MODE_ANGLES) for name in ("modes", "limb_modes"))
    )


def height_insets(road_user: str) -> np.ndarray | None:
    """How far inside the outline of a class its faces are at the `HEIGHTS`, m.

    Of rear, front and sides, mean and standard deviation, (3, 2, 16); None for a file without them.
    """
    known = known_class(road_user)
    return _metres(known["height_insets"]).reshape(3, 2, -1) if "height_insets" in known else None


def visible_shape(road_user: str, sensor: Literal["stixels", "lidar", "outline"]) -> VisibleShape:
    """What stixels (`stixels`), a `lidar` or a sensor of the outline see of `road_user`.

    ValueError if the user's file of the class lacks this sensor.
    """
    sensors = known_class(road_user)
    if sensor not in sensors:
        raise ValueError(
            f"prior.road_user: {road_user} has no visible shape for {sensor}, which "
            f"these scans need: learn it, stixel new class --sensor {sensor}"
        )
    known = sensors[sensor]
    return VisibleShape(
        depth_biases=_metres(known["depth_biases"]).reshape(NODES),
        bias_per_std=known["bias_per_std"],
        depth_stds=_metres(known["depth_stds"]).reshape(NODES),
        std_factor=known["std_factor"],
        insets=_metres(known["insets"]).reshape(2, -1),
        inset_stds=_metres(known["inset_stds"]).reshape(2, -1),
    )


def visible_table(outline: np.ndarray, seen: VisibleShape) -> RayTable:
    """The table of what a sensor sees of an `outline` (N, 2) m."""
    table = outline_table(outline)
    row = np.arange(TABLE[0]) * (NODES[0] / TABLE[0])
    column = np.linspace(0.0, NODES[1] - 1.0, TABLE[1])
    both = np.arange(2.0)
    inset, inset_std = (_interpolated(one.T, row, both).T for one in (seen.insets, seen.inset_stds))
    biases, stds = (_interpolated(one, row, column) for one in (seen.depth_biases, seen.depth_stds))
    return RayTable(
        lowest=table.lowest,
        highest=table.highest,
        depths=table.depths + biases,
        stds=stds,
        low=table.low + inset[0],
        high=table.high - inset[1],
        low_stds=inset_std[0],
        high_stds=inset_std[1],
    )


def _interpolated(nodes: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Bilinear values (n, m) of `nodes` (R, C), whose rows close a circle, at real indices."""
    lower, first = np.floor(row).astype(int), np.minimum(column.astype(int), nodes.shape[1] - 2)
    share, of_next = (row - lower)[:, None], column - first
    rows = nodes[lower % len(nodes)] * (1.0 - share) + nodes[(lower + 1) % len(nodes)] * share
    return rows[:, first] * (1.0 - of_next) + rows[:, first + 1] * of_next


def _metres(millimetres: list[int]) -> np.ndarray:
    return np.array(millimetres) / 1000.0
