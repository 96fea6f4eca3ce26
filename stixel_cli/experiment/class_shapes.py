"""Learn what is known of a class: for `stixel new class`, and for our classes.

Take the mean outline and the mean box of road users, run them on four paths with tuning seeds and
shapes (1000 and above), and fit what stixels and lidars see of them.
"""

import dataclasses
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.errors import located
from stixel_cli.experiment.run import run_experiment
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.contour.class_shape import ClassShape, OutlineModes, VisibleShape
from stixel_cli.tracking.contour.class_size import ClassSize
from stixel_cli.validation import visible_shape

PATHS = ("turn", "crossing", "approach", "s_curve")
SEEDS = range(1000, 1008)
"""Seeds and shape seeds of the scans: so many that some cyclists have panniers, as 30 % have."""
LEAST_SIZE_STD = 0.01
"""Of a class that is learned from a single mesh, relative."""
MEASUREMENTS = {"stixels": ("stixels",), "lidar": ("lidar", "lidar_64")}
"""Options of `measurement` for each kind of sensor."""

Overrides = tuple[str, ...]


def learned_class(
    drawn: Iterable[Overrides], seen: Mapping[int, Overrides], sensors: Sequence[str]
) -> tuple[ClassSize, dict[str, Any]]:
    """The sizes of a class, and what is known of it, see `entry`.

    Args:
        drawn: overrides that choose the road users of the mean outline and size.
        seen: seed to overrides, of the road users that sensors see on all paths.
        sensors: `stixels`, `lidar` and `outline`, or some of them.

    UserError for a damaged mesh.
    """
    configurations = [compose(one).configuration for one in drawn]
    # The motion of the road users does not matter.
    with located(""):
        scenarios = [
            build_scenario(ego_motion(p.ego, 1.0, 0.5), p.road_user, p.path) for p in configurations
        ]
    sizes = np.array([np.ptp(scenario.box_target, axis=0) for scenario in scenarios])
    mean = sizes.mean(axis=0)
    stds = np.maximum(sizes.std(axis=0) / mean, LEAST_SIZE_STD)
    size = ClassSize(mean.round(2), stds.round(2))
    # The size that is written, whole centimetres, is that of the fit.
    shape = dataclasses.replace(visible_shape.class_shape_of(scenarios), size=size.mean)
    visible = {
        sensor: visible_shape.visible_outline_of(scenarios, shape)
        if sensor == "outline"
        else visible_shape.visible_shape_of(_samples(seen, sensor), shape)
        for sensor in sensors
    }
    modes = visible_shape.outline_modes_of(scenarios, shape.size)
    meshes = [road_user_meshes(one.road_user) for one in configurations]
    insets = visible_shape.height_insets_of(meshes)
    return size, entry(size, shape, modes, visible) | {"height_insets": _plain(insets)}


def _samples(road_users: Mapping[int, Overrides], sensor: str) -> list[tuple[Scenario, Scans]]:
    """Ground truth and scans of the road users of each seed on all paths."""
    found = []
    for measurement, path, seed in product(MEASUREMENTS[sensor], PATHS, road_users):
        motion = (f"measurement={measurement}", f"path={path}", f"seed={seed}")
        print(*road_users[seed], *motion, file=sys.stderr)  # noqa: T201
        simple = ("tracker=point", "pictures.frames=[]")
        result = run_experiment(compose((*road_users[seed], *motion, *simple)))
        found.append((result.scenario, result.scans.nearest_returns()[0]))
    return found


def class_text(known: Mapping[str, Any]) -> str:
    """JSON of what is known, with each list in one line."""
    text = json.dumps(known, indent=1)
    return re.sub(r"\[[^\]]+\]", lambda numbers: " ".join(numbers[0].split()), text) + "\n"


def entry(
    size: ClassSize, shape: ClassShape, modes: OutlineModes, seen: Mapping[str, VisibleShape]
) -> dict[str, Any]:
    """One class in the generated file: lengths in whole millimetres."""
    lengths = {
        "size": size.mean,
        "size_stds": size.stds,
        "radii": np.hypot(*shape.outline.T),
        "modes": modes.fixed,
        "limb_modes": modes.limbs,
        **{sensor: vars(values) for sensor, values in seen.items()},
    }
    return _plain(lengths)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, float):
        return round(value, 4)
    return [round(1000.0 * one) for one in value.ravel().tolist()]
