"""The runs of a line of overrides, as the commands make them."""

from stixel_cli.config.compose import Composer
from stixel_cli.sweeps.design import design_runs, sweep_design


def sweep_runs(overrides, file=None):
    return design_runs(sweep_design(overrides, file), Composer())
