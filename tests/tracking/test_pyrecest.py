"""The trackers of PyRecEst, where it is installed."""

import dataclasses
from typing import get_args

import numpy as np
import pytest

from stixel_cli.config.compose import compose
from stixel_cli.errors import UserError
from stixel_cli.geometry.pose import STRAIGHT_AHEAD, world_from_target
from stixel_cli.measurements.scans import Scans
from stixel_cli.tracking.baselines import pyrecest as adapter
from stixel_cli.tracking.baselines.pyrecest import Name
from stixel_cli.tracking.own import check_track
from stixel_cli.tracking.track import InitialState

CONFIGURATION = compose(["tracker=pyrecest"]).configuration
PRIOR, PARAMETERS = CONFIGURATION.prior, CONFIGURATION.tracker
RATES = np.array([1.0, 4.0, 0.0])


def scans_of(count=18):
    """A car that drives ahead, seen all round with little noise; scans 8 to 10 have few points."""
    random = np.random.default_rng(0)
    heading = np.arctan2(RATES[1], RATES[0])
    scans = []
    for k in range(count):
        pose = np.array([2.0, 10.0, heading]) + 0.1 * k * RATES
        angles = random.uniform(0.0, 2.0 * np.pi, {8: 2, 9: 1, 10: 0}.get(k, 30))
        outline = np.stack([2.1 * np.cos(angles), 0.85 * np.sin(angles)], axis=1)
        points = world_from_target(outline, pose) + 0.05 * random.standard_normal((len(angles), 2))
        scans.append((points, np.tile(0.0025 * np.eye(2), (len(angles), 1, 1))))
    poses = np.tile([0.0, 0.0, STRAIGHT_AHEAD], (count, 1))
    return Scans.of_each(0.1 * np.arange(count), poses, scans), heading


def initial_of(heading):
    mean = np.array([2.2, 9.7, heading + 0.05, *RATES]) - 0.1 * np.array([*RATES, 0, 0, 0])
    return InitialState(mean, np.diag([0.3, 0.3, 0.1, 0.5, 0.5, 0.1]) ** 2)


@pytest.mark.parametrize("name", get_args(Name))
def test_each_follows_a_car_through_scans_of_few_points(name):
    pytest.importorskip("pyrecest")
    scans, heading = scans_of()
    parameters = dataclasses.replace(PARAMETERS, name=name, measurement_std=0.1)
    track = adapter.track(scans, initial_of(heading), PRIOR, parameters)
    check_track(track, scans, name)
    true = np.array([2.0, 10.0]) + 0.1 * np.arange(18)[:, None] * RATES[:2]
    assert np.hypot(*(track.means[-5:, :2] - true[-5:]).T).max() < 0.5
    assert np.abs(np.angle(np.exp(1j * (track.means[-1, 2] - heading)))) < 0.3
    x, y = track.contours_world[-1].T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    # Points of an outline are twice as far apart as those of a filled ellipse, which some assume.
    assert 0.4 < area / (np.pi * 2.1 * 0.85) < 2.2, "counter-clockwise and of the car's size"
    assert np.isfinite(track.covariances).all()
    again = adapter.track(scans_of(11)[0], initial_of(heading), PRIOR, parameters)
    assert again.means.tobytes() == track.means[:11].tobytes(), "and later scans change nothing"


def test_without_pyrecest_the_message_names_the_extra(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyrecest", None)
    monkeypatch.setitem(sys.modules, "pyrecest.distributions", None)
    scans, heading = scans_of(2)
    with pytest.raises(UserError, match=r"pip install 'stixel\[peers\]'"):
        adapter.track(scans, initial_of(heading), PRIOR, PARAMETERS)
