"""Scores with metrics of the user's own."""

from dataclasses import replace
from numbers import Real

import numpy as np

from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.scores import Scores
from stixel_cli.measurements.scans import Scans
from stixel_cli.own_code import loaded
from stixel_cli.scene.scenario import Scenario
from stixel_cli.tracking.track import Track


def evaluate_with_own(
    track: Track,
    scenario: Scenario,
    scans: Scans,
    metrics: tuple[str, ...],
    road_user: str | None = None,
) -> Scores:
    """The scores of `evaluate`, and a metric for each of the user's functions, named as it.

    It is called as `function(track, scenario, scans)`. A result of None or NaN is no value.
    ValueError if a result is not a number, or a metric of its name exists.
    """
    scores = evaluate(track, scenario, scans, road_user)
    values = dict(scores.metrics)
    for name in metrics:
        value = loaded(name)(track, scenario, scans)
        metric = name.partition(":")[2]
        if metric in values:
            raise ValueError(f"{name}: a metric {metric} exists: rename the function")
        if value is not None and (isinstance(value, bool) or not isinstance(value, Real)):
            raise ValueError(f"{name}: must return a number, returned a {type(value).__name__}")
        values[metric] = None if value is None or not np.isfinite(value) else float(value)
    return replace(scores, metrics=values)
