"""Estimate what is known of each class, and write `tracking/contour/class_shapes.json`.

    python -m stixel_cli.experiment.class_shapes

takes the mean outline and the mean box of drawn shapes, runs the classes on four paths with tuning
seeds and shapes (1000 and above), and fits what stixels and lidars see of them. Run it again when
the renderer, the matcher, the stixels or the road users' shapes have changed.
"""

import dataclasses
import json
import re
import sys
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.experiment.run import run_experiment
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.classes import ROAD_USER_CLASSES
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.contour import class_size
from stixel_cli.tracking.contour.class_shape import ClassShape, VisibleShape
from stixel_cli.tracking.contour.class_size import ClassSize
from stixel_cli.validation.visible_shape import class_shape_of, visible_outline_of, visible_shape_of

PATHS = ("turn", "crossing", "approach", "s_curve")
SEEDS = range(1000, 1008)
"""Seeds and shape seeds of the scans: so many that some cyclists have panniers, as 30 % have."""
OUTLINES = range(1000, 1020)
"""Shape seeds of the mean outline."""
MEASUREMENTS = {"stixels": ("stixels",), "lidar": ("lidar", "lidar_64")}
"""Options of `measurement` for each kind of sensor."""


def main() -> None:
    """Run the experiments that are not cached, fit, and write the file."""
    shapes = {}
    for road_user in ROAD_USER_CLASSES:
        samples = {sensor: _samples(road_user, sensor) for sensor in MEASUREMENTS}
        drawn = [_scenario(road_user, seed) for seed in OUTLINES]
        sizes = np.array([np.ptp(scenario.box_target, axis=0) for scenario in drawn])
        mean, std = sizes.mean(axis=0), sizes.std(axis=0)
        size = ClassSize(mean.round(2), (std / mean).round(2))
        print(f"conf/prior/{road_user}.yaml: {size}")  # noqa: T201
        # The size that is written, whole centimetres, is that of the fit.
        shape = dataclasses.replace(class_shape_of(drawn), size=size.mean)
        seen = {sensor: visible_shape_of(pairs, shape) for sensor, pairs in samples.items()}
        seen["outline"] = visible_outline_of(drawn, shape)
        shapes[road_user] = entry(size, shape, seen)
    target = Path(class_size.__file__).with_name(class_size.FILES[0])
    text = json.dumps(shapes, indent=1)
    # A list in one line.
    text = re.sub(r"\[[^\]]+\]", lambda numbers: " ".join(numbers[0].split()), text)
    target.write_text(text + "\n", encoding="utf-8")
    print(target)  # noqa: T201


def _scenario(road_user: str, seed: int) -> Scenario:
    """Ground truth of a drawn shape; its motion does not matter."""
    p = compose((f"road_user={road_user}", f"road_user.shape_seed={seed}")).configuration
    return build_scenario(ego_motion(p.ego, 1.0, 0.5), p.road_user, p.path)


def _samples(road_user: str, sensor: str) -> list[tuple[Scenario, Scans]]:
    """Ground truth and scans of a class on all paths and seeds."""
    found = []
    for measurement, path, seed in product(MEASUREMENTS[sensor], PATHS, SEEDS):
        overrides = (
            f"road_user={road_user}",
            f"measurement={measurement}",
            f"path={path}",
            f"seed={seed}",
            f"road_user.shape_seed={seed}",
        )
        print(*overrides, file=sys.stderr)  # noqa: T201
        composition = compose((*overrides, "tracker=point", "pictures.frames=[]"))
        result = run_experiment(composition)
        found.append((result.scenario, result.scans))
    return found


def entry(size: ClassSize, shape: ClassShape, seen: Mapping[str, VisibleShape]) -> dict[str, Any]:
    """One class in the generated file: lengths in whole millimetres."""
    lengths = {
        "size": size.mean,
        "size_stds": size.stds,
        "radii": np.hypot(*shape.outline.T),
        "radius_stds": shape.outline_stds,
        **{sensor: vars(values) for sensor, values in seen.items()},
    }
    return {name: _plain(value) for name, value in lengths.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, float):
        return round(value, 4)
    return [round(1000.0 * one) for one in value.ravel().tolist()]


if __name__ == "__main__":
    main()
