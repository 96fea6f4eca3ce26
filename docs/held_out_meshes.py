"""Write the meshes of the studies that no class knows: python docs/held_out_meshes.py

Those of `study accuracy` (`meshes`) are made of flat-sided blocks and of discs, not of the parts
that the package draws road users from; so are those of `study robustness` that are of no class
(`odd`). Its plain `shapes` and those of the demo in `stixel bench` are upright prisms.
x forward, y left, z up, m.
"""

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parents[1] / "pipelines" / "studies"
ROUND = 2.0 * np.pi * np.arange(72) / 72


Block = tuple[np.ndarray, np.ndarray]


def prism(lower: np.ndarray, upper: np.ndarray) -> Block:
    """The convex block between two rings (n, 3) of corners, counter-clockwise seen from `upper`."""
    count = len(lower)
    ahead = np.arange(count)
    after = (ahead + 1) % count
    sides = [(ahead, after, after + count), (ahead, after + count, ahead + count)]
    fan = np.arange(1, count - 1)
    ends = [(np.zeros_like(fan), fan + 1, fan), (fan * 0 + count, fan + count, fan + count + 1)]
    faces = np.concatenate([np.column_stack(one) for one in (*sides, *ends)])
    return np.concatenate([lower, upper]), faces


def slab(z: tuple, lengths: tuple, widths: tuple, cut: float = 0.0) -> Block:
    """A block from z[0] to z[1]: rear and front x, and width, at its lower and its upper end.

    `cut` of each corner is taken off, m, seen from above.
    """
    rings = []
    for height, (rear, front), width in zip(z, lengths, widths, strict=True):
        middle, half = 0.5 * (rear + front), np.array([0.5 * (front - rear), 0.5 * width])
        corner = [(half[0], half[1] - cut), (half[0] - cut, half[1])]
        signs = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
        # Every second corner is passed in the other direction, so that the ring turns one way.
        ring = [
            (middle + sx * x, sy * y)
            for i, (sx, sy) in enumerate(signs)
            for x, y in (corner if i % 2 == 0 else corner[::-1])
        ]
        rings.append([(x, y, height) for x, y in ring])
    return prism(*np.array(rings))


def disc(x: float, y: float, radius: float, width: float, sides: int = 12) -> Block:
    """A wheel on the ground, its axle across the heading."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.sin(angles), np.zeros(sides), np.cos(angles)]) * radius
    middle = np.array([x, y, radius])
    shift = np.array([0.0, 0.5 * width, 0.0])
    return prism(middle + ring - shift, middle + ring + shift)


def wheels(axles: tuple, track: float, radius: float, width: float) -> list[Block]:
    """Two wheels on each axle."""
    return [disc(x, side * 0.5 * track, radius, width) for x in axles for side in (-1, 1)]


RECTANGLE = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
"""Of side 1, about the origin."""


def upright(z: tuple, ring: np.ndarray) -> Block:
    """A prism from z[0] to z[1] with the footprint `ring` (n, 2), convex and counter-clockwise."""
    return prism(*(np.insert(ring, 2, height, axis=1) for height in z))


MESHES = {
    "meshes/car/pickup": [
        slab((0.35, 1.0), ((-2.6, 2.6), (-2.6, 2.5)), (1.9, 1.86), 0.12),
        slab((1.0, 1.78), ((-0.6, 1.35), (-0.5, 0.55)), (1.8, 1.5), 0.08),
        *wheels((-1.6, 1.6), 1.66, 0.38, 0.24),
    ],
    "meshes/car/box_van": [
        slab((0.25, 0.95), ((-2.2, 2.2), (-2.2, 2.05)), (1.83, 1.83), 0.2),
        slab((0.95, 1.85), ((-2.2, 1.5), (-2.15, 0.75)), (1.83, 1.7), 0.06),
        *wheels((-1.35, 1.35), 1.6, 0.31, 0.2),
    ],
    "meshes/car/wedge": [
        slab((0.15, 0.8), ((-2.1, 2.15), (-2.1, 1.3)), (1.85, 1.8), 0.35),
        slab((0.8, 1.22), ((-1.6, 0.9), (-0.9, 0.1)), (1.5, 1.1), 0.1),
        *wheels((-1.3, 1.3), 1.6, 0.33, 0.25),
    ],
    "meshes/cyclist/city_bike": [
        disc(-0.58, 0.0, 0.34, 0.06),
        disc(0.56, 0.0, 0.34, 0.06),
        slab((0.4, 0.5), ((-0.58, 0.5), (-0.55, 0.45)), (0.08, 0.08)),
        slab((0.7, 0.95), ((0.45, 0.8), (0.4, 0.85)), (0.34, 0.4)),
        slab((0.2, 0.95), ((-0.1, 0.2), (-0.35, 0.05)), (0.3, 0.34)),
        slab((0.95, 1.55), ((-0.42, -0.05), (-0.25, 0.05)), (0.36, 0.48), 0.06),
        slab((1.15, 1.27), ((-0.1, 0.45), (-0.1, 0.45)), (0.5, 0.58)),
        slab((1.58, 1.82), ((-0.2, 0.02), (-0.18, 0.01)), (0.18, 0.18), 0.04),
    ],
    "meshes/pedestrian/pedestrian_in_a_coat": [
        slab((0.0, 0.5), ((-0.3, -0.02), (-0.14, 0.04)), (0.28, 0.3), 0.03),
        slab((0.0, 0.5), ((0.12, 0.4), (0.0, 0.16)), (0.28, 0.3), 0.03),
        slab((0.45, 1.05), ((-0.24, 0.26), (-0.13, 0.14)), (0.52, 0.4), 0.08),
        slab((1.05, 1.48), ((-0.13, 0.14), (-0.12, 0.12)), (0.42, 0.5), 0.06),
        slab((1.52, 1.76), ((-0.1, 0.11), (-0.09, 0.09)), (0.17, 0.16), 0.04),
    ],
    "shapes/car/rectangle": [upright((0.0, 1.5), RECTANGLE * [4.5, 1.8])],
    "shapes/car/trapezium": [
        upright((0.0, 1.5), np.array([(-2.25, -0.9), (2.25, -0.6), (2.25, 0.6), (-2.25, 0.9)]))
    ],
    "shapes/car/l_shape": [
        upright((0.0, 1.5), RECTANGLE * [4.5, 0.9] + [0.0, -0.45]),
        upright((0.0, 1.5), RECTANGLE * [2.25, 0.9] + [-1.125, 0.45]),
    ],
    "shapes/cyclist/rectangle": [upright((0.0, 1.75), RECTANGLE * [1.8, 0.6])],
    # That of docs/tutorials/2_your_own_road_user_and_path.md: load, frame with wheels, rider.
    "shapes/cyclist/cargo_bike": [
        upright((0.3, 0.9), RECTANGLE * [0.9, 0.7] + [0.6, 0.0]),
        upright((0.0, 0.55), RECTANGLE * [2.4, 0.12]),
        upright((0.5, 1.8), RECTANGLE * [0.5, 0.5] + [-0.35, 0.0]),
    ],
    # Of no class: `study robustness` gives each the prior of the class that is nearest to it.
    "odd/car/truck": [
        slab((0.5, 3.4), ((-4.2, 2.0), (-4.2, 2.0)), (2.5, 2.5), 0.05),
        slab((0.5, 2.8), ((2.3, 4.2), (2.3, 3.9)), (2.4, 2.2), 0.15),
        *wheels((-2.6, 3.0), 2.1, 0.5, 0.3),
    ],
    "odd/cyclist/cargo_bike": [
        disc(-0.95, 0.0, 0.34, 0.06),
        disc(1.1, 0.0, 0.25, 0.06),
        slab((0.25, 0.8), ((0.1, 0.95), (0.0, 1.05)), (0.55, 0.65), 0.05),
        slab((0.2, 0.95), ((-0.55, -0.25), (-0.75, -0.35)), (0.3, 0.34)),
        slab((0.95, 1.55), ((-0.8, -0.4), (-0.65, -0.35)), (0.36, 0.48), 0.06),
        slab((1.58, 1.82), ((-0.6, -0.38), (-0.58, -0.39)), (0.18, 0.18), 0.04),
    ],
    "odd/cyclist/motorcycle": [
        disc(-0.72, 0.0, 0.31, 0.17),
        disc(0.72, 0.0, 0.31, 0.12),
        slab((0.25, 0.95), ((-0.75, 0.6), (-0.95, 0.55)), (0.4, 0.3), 0.06),
        slab((0.95, 1.15), ((0.3, 0.6), (0.25, 0.55)), (0.75, 0.8)),
        slab((0.85, 1.4), ((-0.4, 0.05), (-0.25, 0.15)), (0.42, 0.5), 0.06),
        slab((1.42, 1.7), ((-0.15, 0.15), (-0.13, 0.12)), (0.25, 0.24), 0.05),
    ],
    "odd/pedestrian/stroller": [
        *wheels((0.25, 0.85), 0.5, 0.13, 0.05),
        slab((0.35, 1.0), ((0.2, 0.95), (0.15, 0.9)), (0.45, 0.5), 0.05),
        slab((0.95, 1.05), ((-0.35, 0.2), (-0.35, 0.2)), (0.45, 0.45)),
        slab((0.0, 0.9), ((-0.75, -0.35), (-0.65, -0.4)), (0.35, 0.4), 0.05),
        slab((0.9, 1.45), ((-0.65, -0.4), (-0.63, -0.4)), (0.4, 0.5), 0.06),
        slab((1.5, 1.74), ((-0.62, -0.42), (-0.6, -0.43)), (0.17, 0.16), 0.04),
    ],
    "odd/pedestrian/wheelchair": [
        *wheels((-0.25,), 0.6, 0.31, 0.05),
        *wheels((0.32,), 0.45, 0.1, 0.04),
        slab((0.35, 0.6), ((-0.35, 0.3), (-0.35, 0.45)), (0.45, 0.45), 0.05),
        slab((0.1, 0.4), ((0.35, 0.6), (0.3, 0.5)), (0.35, 0.35)),
        slab((0.6, 1.15), ((-0.38, -0.1), (-0.4, -0.15)), (0.4, 0.48), 0.06),
        slab((1.18, 1.4), ((-0.35, -0.15), (-0.34, -0.16)), (0.17, 0.16), 0.04),
    ],
    "../bench/demo/circle": [
        upright((0.0, 1.5), 3.0 * np.stack([np.cos(ROUND), np.sin(ROUND)], axis=1))
    ],
    "../bench/demo/square": [upright((0.0, 1.5), RECTANGLE * [3.0, 3.0])],
    # 5 m long, 4 m wide at its rear.
    "../bench/demo/triangle": [upright((0.0, 1.5), np.array([(-2.5, -2), (2.5, 0), (-2.5, 2)]))],
}
"""Path without its suffix to blocks; the folder above a mesh names its class."""


def main() -> None:
    """Write one Wavefront file for each mesh."""
    for name, blocks in MESHES.items():
        lines, count = ["# made by docs/held_out_meshes.py"], 1
        for points, faces in blocks:
            lines += ["v " + " ".join(f"{value:.4g}" for value in point) for point in points]
            lines += ["f " + " ".join(map(str, face)) for face in faces + count]
            count += len(points)
        file = FOLDER / f"{name}.obj"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
