"""What the user knows of a target's shape: the files of `prior.outline` and `prior.road_user`."""

from pathlib import Path
from typing import Any

import numpy as np
import shapely

from stixel_cli.border.files import read_json, remembered
from stixel_cli.errors import UserError
from stixel_cli.measurements.tables import read_table
from stixel_cli.tracking.contour.class_size import CLASS_SHAPES

MOST_VERTICES = 1000

LONGEST = 30.0
"""Of a road user, m."""

RADII = 360
"""Numbers of a class's outline: a wheel's width is seen under 3 degrees."""

SENSORS = ("stixels", "lidar", "outline")
"""What a class file may say the visible shape for; `outline` is a sensor of the outline itself."""

OPTIONAL = (*SENSORS, "height_insets")
"""Entries that a class file may lack."""


@remembered
def read_outline(file: Path) -> np.ndarray:
    """The vertices (n, 2) m of an outline, counter-clockwise, from the centre of its box.

    The table has the columns x and y, m, along and to the left of the heading.

    Raises:
        UserError: in one line that names the file and what is wrong.
    """
    table = read_table(file, ("x", "y"))
    vertices = np.stack([table["x"], table["y"]], axis=1)
    if not 3 <= len(vertices) <= MOST_VERTICES:
        raise UserError(
            f"{file}: has {len(vertices)} vertices, must have from 3 to {MOST_VERTICES}"
        )
    polygon = shapely.Polygon(vertices)
    if not polygon.is_valid or polygon.area < 0.01 or np.ptp(vertices, axis=0).max() > LONGEST:
        raise UserError(
            f"{file}: must be a polygon that does not cross itself, of at least 0.01 m² and at "
            f"most {LONGEST:g} m"
        )
    centred = vertices - 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    return centred if polygon.exterior.is_ccw else centred[::-1].copy()


@remembered
def read_class(file: Path) -> dict[str, Any]:
    """What a file of `stixel new class` says of a class, as an entry of `class_shapes.json`.

    Raises:
        UserError: in one line that names the file and what is wrong.
    """
    known = read_json(file)
    _check_entry(file, "", known, CLASS_SHAPES["car"])
    if min(known["size"]) < 100 or min(known["size_stds"]) < 1 or min(known["radii"]) < 1:
        raise UserError(f"{file}: size must be at least 100 mm, size_stds and radii at least 1")
    for sensor in (one for one in SENSORS if one in known):
        seen = known[sensor]
        if min(seen["depth_stds"] + seen["inset_stds"]) < 0 or seen["std_factor"] <= 0:
            raise UserError(f"{file}: {sensor}: stds must be ≥ 0 and std_factor > 0")
    return known


def _check_entry(file: Path, name: str, value: Any, like: Any) -> None:
    """Raise UserError unless an entry has the names, or as many numbers, as ours, `like`."""
    if isinstance(like, dict):
        if not isinstance(value, dict):
            raise UserError(f"{file}: {name}: must map names to numbers")
        within = f"{name}." if name else ""
        if unknown := [one for one in value if one not in like]:
            raise UserError(f"{file}: {within}{unknown[0][:40]}: not an entry of a class file")
        for inner in (one for one in like if one in value or one not in OPTIONAL):
            _check_entry(file, within + inner, value.get(inner), like[inner])
        return
    numbers, known = (one if isinstance(one, list) else [one] for one in (value, like))
    right = isinstance(value, list) == isinstance(like, list) and len(numbers) == len(known)
    if not right or not all(
        type(one) in (int, float) and abs(one) <= 1000.0 * LONGEST for one in numbers
    ):
        what = f"{len(known)} numbers" if isinstance(like, list) else "a number"
        raise UserError(f"{file}: {name}: must be {what} within ±{1000 * LONGEST:g}")
