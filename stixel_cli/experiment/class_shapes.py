"""Estimate what is known of each class, and write `tracking/class_shapes.py`.

    python -m stixel_cli.experiment.class_shapes

takes the mean outline and the mean box of drawn shapes, runs the classes on four paths with tuning
seeds and shapes (1000 and above), and fits what stixels and lidars see of them. Run it again when
the renderer, the matcher, the stixels or the road users' shapes have changed.
"""

import dataclasses
import sys
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from textwrap import wrap

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.experiment.run import record_run
from stixel_cli.measurements.scans import Scans
from stixel_cli.scene.build import build_scenario
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.class_shape import ClassShape, SeenShape
from stixel_cli.tracking.class_size import CLASSES, ClassSize
from stixel_cli.validation.seen_shape import class_shape_of, outline_seen_of, seen_shape_of

PATHS = ("turn", "crossing", "approach", "s_curve")
SEEDS = range(1000, 1008)
"""Seeds and shape seeds of the scans: so many that some cyclists have panniers, as 30 % have."""
OUTLINES = range(1000, 1020)
"""Shape seeds of the mean outline."""
MEASUREMENTS = {"simulated": ("simulated",), "lidar": ("lidar", "lidar_64")}
"""Options of `measurement` for each kind of sensor."""

HEADER = '''"""Generated: what is known of each class of road user; `class_shape.py` explains it.

Made by: python -m stixel_cli.experiment.class_shapes
Outlines of shape seeds {outlines}; scans of paths {paths}, seeds and
shape seeds {seeds}. Lengths are whole millimetres; size_stds are thousandths of
the size.
"""

SHAPES = {{
'''


def main() -> None:
    """Run the experiments that are not cached, fit, and write the module."""
    text = HEADER.format(
        paths=", ".join(PATHS),
        seeds=f"{SEEDS[0]} to {SEEDS[-1]}",
        outlines=f"{OUTLINES[0]} to {OUTLINES[-1]}",
    )
    for road_user in CLASSES:
        samples = {sensor: _samples(road_user, sensor) for sensor in MEASUREMENTS}
        drawn = [_scenario(road_user, seed) for seed in OUTLINES]
        sizes = np.array([np.ptp(scenario.box_target, axis=0) for scenario in drawn])
        mean, std = sizes.mean(axis=0), sizes.std(axis=0)
        size = ClassSize(mean.round(2), (std / mean).round(2))
        print(f"conf/prior/{road_user}.yaml: {size}")  # noqa: T201
        # The size that is written, whole centimetres, is that of the fit.
        shape = dataclasses.replace(class_shape_of(drawn), size=size.mean)
        seen = {sensor: seen_shape_of(pairs, shape) for sensor, pairs in samples.items()}
        seen["outline"] = outline_seen_of(drawn, shape)
        text += entry(road_user, size, shape, seen)
    target = Path(__file__).parents[1] / "tracking" / "class_shapes.py"
    target.write_text(text + "}\n", encoding="utf-8")
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
        command = ["stixel", "run", *overrides]
        result = record_run(composition, command, results=None, name=None)
        found.append((result.scenario, result.scans))
    return found


def entry(road_user: str, size: ClassSize, shape: ClassShape, seen: Mapping[str, SeenShape]) -> str:
    """The text of one class in the generated module."""
    lines = [f'    "{road_user}": {{']
    lines += _lengths("size", size.mean)
    lines += _lengths("size_stds", size.stds)
    lines += _lengths("radii", np.hypot(*shape.outline.T))
    lines += _lengths("radius_stds", shape.outline_stds)
    for sensor, values in seen.items():
        lines.append(f'        "{sensor}": {{')
        for field in dataclasses.fields(values):
            value = getattr(values, field.name)
            if isinstance(value, float):
                lines.append(f'        "{field.name}": {value:.4f},')
            else:
                lines += _lengths(field.name, value)
        lines.append("        },")
    return "\n".join([*lines, "    },\n"])


def _lengths(name: str, values: np.ndarray) -> list[str]:
    """The lines of one entry: lengths in m as whole millimetres."""
    numbers = " ".join(f"{1000.0 * value:.0f}" for value in values.ravel())
    return [f'        "{name}": """', *wrap(numbers, 100), '        """,']


if __name__ == "__main__":
    main()
