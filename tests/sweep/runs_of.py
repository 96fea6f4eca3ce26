"""The runs of a line of overrides, as the commands make them."""

from stixel_cli.sweeps.runs import design_runs, shuffled_runs, sweep_design


def sweep_runs(overrides, file=None, shuffle_seed=None):
    design = sweep_design(overrides, file, shuffle_seed)
    return shuffled_runs(design_runs(design), shuffle_seed)
