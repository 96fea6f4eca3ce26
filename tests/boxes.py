"""A box as a mesh of the user's own."""

from itertools import product

SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def write_box(file, length=2.0, width=1.0, height=1.5):
    """Write a box on the ground in Wavefront's format, its middle at the origin; return `file`."""
    corners = product((-length / 2, length / 2), (-width / 2, width / 2), (0, height))
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    for a, b, c, d in SIDES:
        lines += [f"f {a + 1} {b + 1} {c + 1}", f"f {a + 1} {c + 1} {d + 1}"]
    file.write_text("\n".join(lines), encoding="utf-8")
    return file
