"""Where a tracker starts: the truth, with noise."""

import numpy as np

from stixel_cli.randomness import generator
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.motion import intervals, transition
from stixel_cli.tracking.parameters import StartParameters
from stixel_cli.tracking.track import InitialState


def noisy_start(scenario: Scenario, start: StartParameters, seed: int) -> InitialState:
    """The true pose and rates with Gaussian noise, one sample before the first scan.

    A tracker predicts, then updates, at every scan, the first included. So the start is the
    target moved back by one sample at its rates of k = 0: predicted to k = 0 without noise it is
    the truth.
    """
    truth = np.concatenate([scenario.target_poses_world[0], scenario.target_rates_world[0]])
    before = transition(-float(intervals(scenario.times)[0])) @ truth
    deviations = np.array(
        [start.position] * 2 + [start.heading] + [start.velocity] * 2 + [start.heading_rate]
    )
    noise = deviations * generator(seed, "start").standard_normal(6)
    return InitialState(mean=before + noise, covariance=np.diag(deviations**2))
