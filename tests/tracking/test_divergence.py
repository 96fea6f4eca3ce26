"""Every tracker's run ends with a warning if the tracker loses the points."""

from importlib import import_module
from typing import get_args

import numpy as np
import pytest
from seen_targets import scans_seen, start_at, turning

from stixel_cli.config.annotations import kind_of
from stixel_cli.config.compose import compose
from stixel_cli.config.schema import Tracker
from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.scene.scenario import Scenario

OUTLINE = np.array([[2.1, 0.85], [-2.1, 0.85], [-2.1, -0.85], [2.1, -0.85]])


# `tracker=file` reads its track.
TRACKERS = {"no_data", *map(kind_of, get_args(Tracker))} - {"file"}


@pytest.mark.parametrize("name", sorted(TRACKERS))
def test_a_target_that_jumps_away_gives_a_warning(name):
    if name == "pyrecest":
        pytest.importorskip("pyrecest")
    configuration = compose([f"tracker={name}"]).configuration
    module = import_module(type(configuration.tracker).__module__.removesuffix("_parameters"))
    poses = turning(24, 2.0, 0.1, (-3.0, 12.0))
    jumped = poses + np.where(np.arange(24) < 8, 0.0, 25.0)[:, None] * [0.0, 1.0, 0.0]
    rates = np.gradient(poses, 0.1, axis=0)
    # A tracker without scans cannot lose them.
    for path, warned in ((poses, False), (jumped, name != "no_data")):
        scans = scans_seen(OUTLINE, path, noise=0.03)
        result = module.track(scans, start_at(poses), configuration.prior, configuration.tracker)
        truth = Scenario(scans.times, scans.sensor_poses_world, path, rates, OUTLINE[None])
        metrics = evaluate(result, truth, scans).metrics
        assert metrics["diverged"] == warned
        assert verdict(metrics)[0].startswith("WARNING") == warned
        if warned:
            assert metrics["time_to_divergence_s"] == pytest.approx(0.8)
