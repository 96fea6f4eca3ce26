"""The sizes of the classes of road users, as far as a prior knows the class."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stixel_cli.scene.parameters import ROAD_USER_CLASSES, RoadUserClass
from stixel_cli.tracking.prior import PriorShape

FILES = ["class_shapes.json"]

CLASS_SHAPES = json.loads(Path(__file__).with_name(FILES[0]).read_text("utf-8"))
"""What is known of each class, see `class_shape.py`. Lengths are whole millimetres, `size_stds`
thousandths of the size. Made by `python bench/class_shapes.py`."""


@dataclass(frozen=True)
class ClassSize:
    """The boxes of a class, in all poses of the limbs."""

    mean: np.ndarray
    """(2,) m, length and width."""
    stds: np.ndarray
    """(2,) relative to the mean."""


def class_size(road_user: RoadUserClass) -> ClassSize:
    """The boxes of `road_user` from `class_shapes.json`; `conf/prior` has the same values."""
    known = CLASS_SHAPES[road_user]
    return ClassSize(*(np.array(known[name]) / 1000.0 for name in ("size", "size_stds")))


SIZES = np.stack([class_size(road_user).mean for road_user in ROAD_USER_CLASSES])
"""Length and width of each class, m."""


def states_size(prior: PriorShape) -> bool:
    """Whether the user states a size that is not that of the prior's class."""
    if prior.road_user not in ROAD_USER_CLASSES:
        return False
    size = class_size(prior.road_user).mean
    return not np.allclose([prior.length, prior.width], size, rtol=5e-3)


def possible_sizes(prior: PriorShape) -> np.ndarray:
    """Lengths and widths (n, 2) m: of the prior's class; of every class if it is unknown."""
    if prior.road_user == "unknown":
        return SIZES
    return np.array([[prior.length, prior.width]])
