"""The runs of a line of overrides, as the commands make them, and a mesh."""

from stixel_cli.sweeps.runs import design_runs, sweep_design

TETRAHEDRON = "v -2 -1 0\nv 2 -1 0\nv 2 1 0\nv -2 1 0\nv 0 0 {}\nf 1 3 2\nf 1 4 3\n" + "".join(
    f"f {a} {b} 5\n" for a, b in ((1, 2), (2, 3), (3, 4), (4, 1))
)
"""A mesh whose height, m, is to be filled in."""


def sweep_runs(overrides, file=None):
    return design_runs(sweep_design(overrides, file))
