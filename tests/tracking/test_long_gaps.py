"""Every tracker stays finite over the longest gap of scans; longer ones are refused."""

from importlib import import_module
from typing import get_args

import numpy as np
import pytest
from seen_targets import scans_seen, start_at, turning

from stixel_cli.config.annotations import kind_of
from stixel_cli.config.compose import compose
from stixel_cli.config.schema import Tracker
from stixel_cli.measurements.scans import FARTHEST, Scans
from stixel_cli.tracking.track import check_finite

OUTLINE = np.array([[2.1, 0.85], [-2.1, 0.85], [-2.1, -0.85], [2.1, -0.85]])
POSES = turning(8, 2.0, 0.1, (-3.0, 12.0))


TRACKERS = [kind for kind in map(kind_of, get_args(Tracker)) if kind != "file"]
SMOOTHED = [f"{name} tracker.lag=null" for name in ("contour", "gp_ekf", "point")]


@pytest.mark.parametrize("name", TRACKERS + SMOOTHED)
@pytest.mark.parametrize("gap", [1e4, 1e6, 2.0 * FARTHEST])
def test_a_long_gap(name, gap):
    if name == "pyrecest":
        pytest.importorskip("pyrecest")
    configuration = compose(f"tracker={name}".split()).configuration
    module = import_module(type(configuration.tracker).__module__.removesuffix("_parameters"))
    scans = scans_seen(OUTLINE, POSES, noise=0.03)
    late = np.where(np.arange(8) < 5, scans.times - FARTHEST, scans.times - FARTHEST + gap)
    late = np.minimum(late, FARTHEST)
    scans = Scans(
        late,
        scans.sensor_poses_world,
        scans.offsets,
        scans.points_world,
        scans.covariances_world,
        scans.field_of_view,
    )
    try:
        track = module.track(scans, start_at(POSES), configuration.prior, configuration.tracker)
    except ValueError as error:
        # The peers are not ours to mend: they end in one line that names the scan.
        assert name == "pyrecest" and "failed at scan" in str(error)
    else:
        check_finite(track)
        assert (track.smoothed is not None) == (name in SMOOTHED)
        check_finite(track.smoothed or track)


@pytest.mark.parametrize("time", [1e9, np.nan, -np.inf])
def test_later_times_are_refused(time):
    with pytest.raises(ValueError, match="time of scan 1"):
        Scans.of_each([0.0, time], np.zeros((2, 3)), [(np.zeros((0, 2)), np.zeros((0, 2, 2)))] * 2)
