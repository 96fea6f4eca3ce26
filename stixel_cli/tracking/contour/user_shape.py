"""What the user knows of a target's shape: the files of `prior.outline` and `prior.road_user`."""

from pathlib import Path
from typing import Any

import numpy as np
import shapely

from stixel_cli.border.files import read_json, remembered
from stixel_cli.errors import UserError
from stixel_cli.measurements.tables import read_table

MOST_VERTICES = 1000

LONGEST = 30.0
"""Of a road user, m."""

SENSORS = ("stixels", "lidar", "outline")
"""What a class file may say the visible shape for; `outline` is a sensor of the outline itself."""

RADII = 360
"""Numbers of a class's outline: a wheel's width is seen under 3 degrees."""

COUNTS = {"size": 2, "size_stds": 2, "radii": RADII, "modes": 12 * 120, "limb_modes": 6 * 120}
OPTIONAL = {"height_insets": 96}
COUNTS_OF_SENSOR = {
    "depth_biases": 216,
    "depth_stds": 216,
    "insets": 48,
    "inset_stds": 48,
    "bias_per_std": None,
    "std_factor": None,
}
"""Numbers of each entry of a class file, see `class_shape.py`; None: a single one."""


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
    counts = COUNTS | {name: count for name, count in OPTIONAL.items() if name in known}
    _check_entries(file, "", known, counts, (*counts, *SENSORS))
    if min(known["size"]) < 100 or min(known["size_stds"]) < 1 or min(known["radii"]) < 1:
        raise UserError(f"{file}: size must be at least 100 mm, size_stds and radii at least 1")
    for sensor in SENSORS:
        if sensor in known:
            if not isinstance(known[sensor], dict):
                raise UserError(f"{file}: {sensor}: must map names to numbers")
            _check_entries(file, f"{sensor}.", known[sensor], COUNTS_OF_SENSOR, COUNTS_OF_SENSOR)
            stds = [*known[sensor]["depth_stds"], *known[sensor]["inset_stds"]]
            if min(stds) < 0 or known[sensor]["std_factor"] <= 0:
                raise UserError(f"{file}: {sensor}: stds must be ≥ 0 and std_factor > 0")
    return known


def _check_entries(file: Path, within: str, known: Any, counts: Any, allowed: Any) -> None:
    unknown = [name for name in known if name not in allowed]
    if unknown:
        raise UserError(f"{file}: {within}{unknown[0][:40]}: not an entry of a class file")
    for name, count in counts.items():
        values = known.get(name)
        numbers = values if isinstance(values, list) else [values]
        right = isinstance(values, list) == (count is not None) and len(numbers) == (count or 1)
        if not right or not all(
            type(one) in (int, float) and abs(one) <= 1000.0 * LONGEST for one in numbers
        ):
            what = "a number" if count is None else f"{count} numbers"
            raise UserError(f"{file}: {within}{name}: must be {what} within ±{1000 * LONGEST:g}")
