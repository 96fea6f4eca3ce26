"""The example of a user's own scans: it is read, and a track can start from it."""

import runpy
from pathlib import Path

import numpy as np

from stixel_cli.config.compose import compose
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import read_truth
from stixel_cli.tracking.motion import transition
from stixel_cli.tracking.start_scans import start_from_scans

EXAMPLE = Path(__file__).parents[2] / "examples" / "radar_scans.py"


def test_the_example_is_a_run_s_input(tmp_path):
    runpy.run_path(str(EXAMPLE))["main"](tmp_path)
    scans = read_scans(str(tmp_path / "scans.csv"), str(tmp_path / "ego.csv"), 0.2)
    truth = read_truth(scans, str(tmp_path / "truth.csv"))
    assert len(scans) == 60
    assert np.all(np.diff(scans.offsets)[9::10] == 0)
    configuration = compose(["start=scans"]).configuration
    state = start_from_scans(scans, configuration.start, configuration.prior)
    first = transition(scans.times[1]) @ state.mean
    assert np.hypot(*(first[:2] - truth.target_poses_world[0, :2])) < 1.0
    assert np.hypot(*(first[3:5] - truth.target_rates_world[0, :2])) < 2.0
