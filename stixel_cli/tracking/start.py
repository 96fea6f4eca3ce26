"""Initialisation of a tracker: the truth, with noise."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Le

from stixel_cli.parameters import parameters
from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.track import InitialState

NO_TRUTH = (
    "start: there is no truth to start from: choose start=scans, or give measurement.truth=FILE"
)


@parameters
class TruthStart:
    """What a tracker starts from: the true pose plus noise, and its rates.

    Attributes:
        rates: `truth`: the true rates plus noise; `zero`: mean 0.
        position: standard deviation of x and of y, m; the others are standard deviations too.
        heading: rad.
        velocity: of the rates of x and of y, m/s.
        heading_rate: rad/s.
    """

    kind: Literal["truth"]
    rates: Literal["truth", "zero"]
    position: Annotated[float, Gt(0), Le(100)]
    heading: Annotated[float, Gt(0), Le(3.2)]
    velocity: Annotated[float, Gt(0), Le(100)]
    heading_rate: Annotated[float, Gt(0), Le(10)]


def noisy_start(scenario: Scenario, start: TruthStart, seed: int) -> InitialState:
    """The true pose with Gaussian noise and the rates, one sample before the first scan.

    A tracker predicts, then updates, at every scan, the first included. So the start is the
    target moved back by one sample at its rates of k = 0: predicted to k = 0 without noise it is
    the truth. With `rates=zero` (thesis, 8.2.1: only position and heading are initialised) the
    rates are 0 and the pose is the one of k = 0; the noise of the pose is the same. If the truth is
    unknown at k = 0, the first known pose is moved back.

    Raises:
        ValueError: without any truth.
    """
    known = np.flatnonzero(scenario.known)
    if len(known) == 0:
        raise ValueError(NO_TRUTH)
    pose, rates = scenario.target_poses_world[known[0]], scenario.target_rates_world[known[0]]
    if start.rates == "zero":
        rates = np.zeros(3)
    age = scenario.times[known[0]] - scenario.times[0] + intervals(scenario.times)[0]
    before = transition(-float(age)) @ np.concatenate([pose, rates])
    velocity, rate = [start.velocity] * 2, start.heading_rate
    std = np.array([*[start.position] * 2, start.heading, *velocity, rate])
    noise = std * generator(seed, "start").standard_normal(6)
    if start.rates == "zero":
        noise[3:] = 0.0
    return InitialState(mean=before + noise, covariance=np.diag(std**2))
