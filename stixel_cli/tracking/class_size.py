"""The sizes of the classes of road users, as far as a prior knows the class."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from stixel_cli.tracking import class_shapes
from stixel_cli.tracking.prior import PriorShape

RoadUserClass = Literal["car", "cyclist", "pedestrian"]

CLASSES: tuple[RoadUserClass, ...] = get_args(RoadUserClass)


@dataclass(frozen=True)
class ClassSize:
    """The boxes of a class, in all poses of the limbs.

    Attributes:
        mean: (2,) m, length and width.
        stds: (2,) relative to the mean.
    """

    mean: np.ndarray
    stds: np.ndarray


def class_size(road_user: RoadUserClass) -> ClassSize:
    """The boxes of `road_user` from `class_shapes.py`; `conf/prior` has the same values."""
    known = class_shapes.SHAPES[road_user]
    mean, stds = (
        np.array(known[name].split(), dtype=np.float64) / 1000.0 for name in ("size", "size_stds")
    )
    return ClassSize(mean, stds)


SIZES = np.stack([class_size(road_user).mean for road_user in CLASSES])
"""Length and width of each class, m."""


def possible_sizes(prior: PriorShape) -> np.ndarray:
    """Lengths and widths (n, 2) m: of the prior's class; of every class if it is unknown."""
    if prior.road_user == "unknown":
        return SIZES
    return np.array([[prior.length, prior.width]])
