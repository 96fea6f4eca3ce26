"""The points of a line of overrides, as the commands make them."""

from stixel_cli.sweeps.points import design_points, shuffled_points, sweep_design


def sweep_points(overrides, file=None, shuffle_seed=None):
    design = sweep_design(overrides, file, shuffle_seed)
    return shuffled_points(design_points(design), shuffle_seed)
