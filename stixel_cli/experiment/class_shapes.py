"""Estimate what is known of each class, and write `tracking/class_shapes.py`.

    python -m stixel_cli.experiment.class_shapes

runs the classes on four paths with tuning seeds (1000 and above) and fits their seen shapes. Run it
again when the renderer, the matcher, the stixels or the road users' shapes have changed.
"""

import sys
from pathlib import Path
from textwrap import fill

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.experiment.run import record_run
from stixel_cli.tracking.class_shape import ClassShape
from stixel_cli.validation.seen_shape import class_shape_of

CLASSES = ("car", "cyclist", "pedestrian")
PATHS = ("turn", "crossing", "approach", "s_curve")
SEEDS = (1000, 1001, 1002)

HEADER = '''"""Generated: what is known of each class of road user; `class_shape.py` explains it.

Made by: python -m stixel_cli.experiment.class_shapes
Paths {paths}; seeds {seeds}. Lengths are whole millimetres.
"""

SHAPES = {{
'''


def main() -> None:
    """Run the experiments that are not cached, fit, and write the module."""
    text = HEADER.format(paths=", ".join(PATHS), seeds=", ".join(map(str, SEEDS)))
    for road_user in CLASSES:
        samples = []
        for path in PATHS:
            for seed in SEEDS:
                overrides = (f"road_user={road_user}", f"path={path}", f"seed={seed}")
                result = record_run(
                    compose((*overrides, "tracker=point", "pictures.frames=[]")),
                    ["stixel", "run", *overrides],
                    results=None,
                    name=None,
                )
                samples.append((result.scenario, result.scans))
                print(*overrides, file=sys.stderr)  # noqa: T201
        text += entry(road_user, class_shape_of(samples))
    target = Path(__file__).parents[1] / "tracking" / "class_shapes.py"
    target.write_text(text + "}\n", encoding="utf-8")
    print(target)  # noqa: T201


def entry(road_user: str, shape: ClassShape) -> str:
    """The text of one class in the generated module."""
    lengths = {
        "radii": np.hypot(*shape.outline.T),
        "radius_stds": shape.outline_stds,
        "depth_biases": shape.depth_biases,
        "depth_stds": shape.depth_stds,
        "insets": shape.insets,
        "inset_stds": shape.inset_stds,
    }
    numbers = {"bias_per_std": shape.bias_per_std, "std_factor": shape.std_factor}
    lines = [f'    "{road_user}": {{']
    lines += [f'        "{name}": {value:.4f},' for name, value in numbers.items()]
    for name, values in lengths.items():
        lines.append(f'        "{name}": """')
        lines.append(fill(" ".join(f"{1000.0 * value:.0f}" for value in values.ravel()), 100))
        lines.append('        """,')
    return "\n".join([*lines, "    },\n"])


if __name__ == "__main__":
    main()
