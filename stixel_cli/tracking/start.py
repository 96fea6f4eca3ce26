"""Initialisation of a tracker: the truth, with noise."""

from typing import Annotated

import numpy as np
from annotated_types import Gt, Le

from stixel_cli.parameters import parameters
from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.track import InitialState


@parameters
class StartParameters:
    """Standard deviations of the noise on the true pose and rates that a tracker starts from.

    Attributes:
        position: of x and of y, m.
        heading: rad.
        velocity: of the rates of x and of y, m/s.
        heading_rate: rad/s.
    """

    position: Annotated[float, Gt(0), Le(100)]
    heading: Annotated[float, Gt(0), Le(3.2)]
    velocity: Annotated[float, Gt(0), Le(100)]
    heading_rate: Annotated[float, Gt(0), Le(10)]


def noisy_start(scenario: Scenario, start: StartParameters, seed: int) -> InitialState:
    """The true pose and rates with Gaussian noise, one sample before the first scan.

    A tracker predicts, then updates, at every scan, the first included. So the start is the
    target moved back by one sample at its rates of k = 0: predicted to k = 0 without noise it is
    the truth.
    """
    truth = np.concatenate([scenario.target_poses_world[0], scenario.target_rates_world[0]])
    before = transition(-float(intervals(scenario.times)[0])) @ truth
    std = np.array(
        [start.position] * 2 + [start.heading] + [start.velocity] * 2 + [start.heading_rate]
    )
    noise = std * generator(seed, "start").standard_normal(6)
    return InitialState(mean=before + noise, covariance=np.diag(std**2))
