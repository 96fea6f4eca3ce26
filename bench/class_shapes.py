"""What `tracker=contour` knows of our classes: `stixel_cli/tracking/contour/class_shapes.json`.

`python bench/class_shapes.py` writes the file and prints the sizes for `conf/prior`. Run it again
when the renderer, the matcher, the stixels or the road users' shapes have changed; experiments that
are cached are not run again.
"""

from pathlib import Path

from stixel_cli.experiment.class_shapes import MEASUREMENTS, SEEDS, class_text, learned_class
from stixel_cli.scene.parameters import ROAD_USER_CLASSES
from stixel_cli.tracking.contour import class_size

OUTLINES = range(1000, 1020)
"""Shape seeds of the mean outline."""

WIDTH_STDS = {"car": 68}
"""Thousandths of the width where the drawn shapes are more alike than real ones: of KITTI's labels
of cars, 1.62 ± 0.11 m (579 objects)."""


def main() -> None:
    """Learn our classes and write the file."""
    shapes = {}
    for road_user in ROAD_USER_CLASSES:
        drawn, seen = (
            {seed: (f"road_user={road_user}", f"road_user.shape_seed={seed}") for seed in seeds}
            for seeds in (OUTLINES, SEEDS)
        )
        size, shapes[road_user] = learned_class(drawn.values(), seen, (*MEASUREMENTS, "outline"))
        if road_user in WIDTH_STDS:
            shapes[road_user]["size_stds"][1] = WIDTH_STDS[road_user]
        print(f"conf/prior/{road_user}.yaml: {size}, {shapes[road_user]['size_stds']}")
    target = Path(class_size.__file__).with_name(class_size.FILES[0])
    target.write_text(class_text(shapes), encoding="utf-8")
    print(target)


if __name__ == "__main__":
    main()
