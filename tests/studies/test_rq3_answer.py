"""RQ3: what the answer says, and what it must not say of few pairs."""

from types import SimpleNamespace

import numpy as np
import pytest
from study_toy import answer_of

from stixel_cli.config.compose import compose
from stixel_cli.report.cost import cost_of
from stixel_cli.report.statistics import paired
from stixel_cli.results.result import RunResult
from stixel_cli.studies.rq3.compare import (
    FABRICATED,
    FITTED,
    SIMULATED,
    Comparison,
    Measure,
    _corrected,
    gap_closed,
    reach_of,
)
from stixel_cli.studies.rq3.report import answer_values

COST = cost_of(simulated=(), fabricated=())


def family(pairs, labels, tracker="", gap=-0.2):
    """Comparisons of two road users, all pairs of one sign."""
    spread = np.linspace(-0.02, 0.02, pairs)
    paths = ["turn"] * pairs
    found = []
    for user in ("car", "cyclist"):
        for label in labels:
            apart = {FABRICATED: paired(gap + spread, paths), FITTED: paired(spread, paths)}
            means = {SIMULATED: 0.3, FABRICATED: 0.3 + gap, FITTED: 0.3}
            closed = gap_closed(gap + spread, spread, paths, label)
            measure = Measure(label, "m")
            found.append(Comparison(user, tracker, measure, means, apart, {}, closed))
    return _corrected(found)


def said(pairs, gap=-0.2):
    points = family(pairs, [f"measure {i}" for i in range(11)] + ["bias along the ray"], gap=gap)
    tracks = family(pairs, ["centre RMSE"], "GP-EKF", gap)
    return answer_of(
        "rq3", answer_values(points, tracks) | {"cost": COST, "seeds": pairs, "paths": 1}
    )


def test_few_pairs_allow_no_test():
    first, car, _, few, effects, trackers, *rest = said(6)
    assert first == (
        "With GP-EKF, the centre RMSE on fabricated measurements, against simulated ones, is "
        "0.2 m smaller for the car and the cyclist (n = 6 pairs of runs)."
    )
    text = " ".join(rest)
    assert (
        "too few for a significant test of the points and trackers. With n = 6 pairs, the smallest "
        "p of Wilcoxon's signed rank test with Holm's correction is 1.00 for the 48 tests of the "
        "points and 0.125 for the 4 tests of the trackers. A p below 0.05 requires n = 11 pairs."
    ) in few
    assert car == (
        "Car, GP-EKF: centre RMSE 0.30\u202fm simulated, 0.10\u202fm fabricated, "
        "difference −0.200\u202fm [−0.216, −0.184]."
    )
    # No verdict of a test that could not have found anything; effects with their intervals instead.
    for verdict in (
        "the test shows",
        "corrected test",
        "distinguishes fabricated",
        "no difference",
    ):
        assert verdict not in text
    assert effects.startswith(
        "Points: mean difference, fabricated minus simulated [95 %]. Car: bias along "
    )
    assert "bias along the ray −0.200\u202fm [−0.216, −0.184]" in effects
    assert trackers.startswith("GP-EKF: mean difference, fabricated minus simulated")
    assert "points' 24 gaps whose interval excludes 0" in text


def test_effects_come_before_tests():
    _, _, _, first, _, _, tests, *rest = said(15)
    assert first.startswith(
        "Points: mean difference, fabricated minus simulated [95 %]. Car: bias along "
    )
    assert "distinguishes fabricated from simulated points in 24 of 24 comparisons" in tests
    assert "GP-EKF: the corrected test shows a difference for the car (centre)" in rest[0]
    assert "points' 24 gaps that the test shows" in " ".join(rest)
    # Jinja takes `one.clear` for the method of a dict.
    assert "<" not in " ".join(rest)
    text = " ".join(said(15, gap=0.0))
    assert "in 0 of 24 comparisons" in text and "does not show that the measurements" in text


@pytest.mark.parametrize(("pairs", "enough"), [(1, False), (10, False), (11, True)])
def test_the_reach_of_a_family_of_tests(pairs, enough):
    reach = reach_of(family(pairs, [f"measure {i}" for i in range(12)]))
    assert (reach.pairs, reach.tests, reach.enough) == (pairs, 48, enough)
    assert reach.needed == 11


def test_the_cost_is_unknown_unless_all_cpu_times_are_recorded():
    def runs(**seconds):
        scores = SimpleNamespace(times=np.zeros(10))
        manifest = {"seed": 0}
        return [RunResult({}, manifest, composition=compose(), scores=scores, cpu_seconds=seconds)]

    def cost(simulated, fabricated):
        return cost_of(simulated=simulated, fabricated=fabricated)

    found = cost(runs(scenario=9.0, render=2.0, scans=0.5), runs(scenario=9.0, scans=0.01))
    assert found["simulated_total"] == pytest.approx(0.25)
    assert found["ratio"] == pytest.approx(250.0)
    # A stage of an entry that has no CPU seconds is not left out of the sum.
    assert cost(runs(render=np.nan, scans=0.5), runs(scans=0.01))["ratio"] is None
