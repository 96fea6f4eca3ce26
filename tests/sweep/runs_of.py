"""The runs of a line of overrides, as the commands make them, and runs made by hand."""

from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.runs import design_runs, shuffled_runs, sweep_design


def sweep_runs(overrides, file=None, shuffle_seed=None):
    design = sweep_design(overrides, file, shuffle_seed)
    return shuffled_runs(design_runs(design), shuffle_seed)


def run_of(setting, seed, metrics, index=0):
    """A finished run of a sweep."""
    manifest = {"run": index, "seed": seed, "swept": setting}
    return RunResult(manifest=manifest, metrics=metrics, label=str(setting))
