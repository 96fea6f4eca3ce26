"""The classes of road users, one row each."""

from dataclasses import dataclass
from typing import Literal, get_args

RoadUserClass = Literal["car", "cyclist", "pedestrian"]


@dataclass(frozen=True)
class ClassRow:
    """Names of a class in other formats, and its speed.

    Attributes:
        kitti_types: types of KITTI's labels that are of this class; exported labels have the first.
        stx1_type: type of pyStixel-lib's segmentation.
        speed: root mean square speed, m/s.
        reverse_speed: it drives or walks backwards no faster, m/s.
        argoverse_category: of Argoverse's labels; None without one: its BICYCLIST is only the
            rider, and the BICYCLE has a label of its own.
    """

    kitti_types: tuple[str, ...]
    stx1_type: str
    speed: float
    reverse_speed: float
    argoverse_category: str | None = None


CLASS_ROWS: dict[RoadUserClass, ClassRow] = {
    "car": ClassRow(("Car", "Van"), "TYPE_CAR", 12.0, 3.0, "REGULAR_VEHICLE"),
    "cyclist": ClassRow(("Cyclist",), "TYPE_BICYCLIST", 5.0, 0.3),
    "pedestrian": ClassRow(
        ("Pedestrian", "Person_sitting"), "TYPE_PEDESTRIAN", 1.2, 0.3, "PEDESTRIAN"
    ),
}

ROAD_USER_CLASSES: tuple[RoadUserClass, ...] = get_args(RoadUserClass)

CLASS_OF_KITTI_TYPE = {kitti: name for name, row in CLASS_ROWS.items() for kitti in row.kitti_types}
"""The class of road user of each type of KITTI's labels that has one."""
