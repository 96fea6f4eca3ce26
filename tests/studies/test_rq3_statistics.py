import numpy as np
from scipy.stats import ttest_1samp, ttest_ind

from stixel_cli.report.intervals import bootstrap_weights, combined_interval, stratified_parts
from stixel_cli.report.statistics import (
    SIGNIFICANT,
    holm,
    least_p,
    paired,
    pairs_needed,
    rank_biserial,
    wilcoxon,
)
from stixel_cli.studies.rq3.compare import gap_closed


def test_holm_on_an_example():
    # Four tests: 4 * 0.01, max(3 * 0.02, …), max(2 * 0.03, …), 0.04 not below the one before.
    corrected = holm({"a": 0.03, "b": 0.01, "c": 0.04, "d": 0.02})
    np.testing.assert_allclose([corrected[key] for key in "bdac"], [0.04, 0.06, 0.06, 0.06])
    assert holm({"a": 0.9, "b": 0.8})["a"] == 1.0
    assert holm({}) == {}


def test_rank_biserial():
    assert rank_biserial(np.array([1.0, 2.0, 3.0])) == 1.0
    assert rank_biserial(np.array([-1.0, -2.0, 0.0])) == -1.0
    # Ranks 1, 2, 3, 4; the second is negative: (8 - 2) / 10.
    assert rank_biserial(np.array([1.0, -2.0, 3.0, 4.0])) == 0.6
    assert rank_biserial(np.zeros(3)) is None


def test_wilcoxon_of_small_samples_is_exact():
    # All of n differences of one sign: 2 / 2^n.
    assert wilcoxon(np.arange(1.0, 7.0)) == 2.0 / 2**6
    assert wilcoxon(np.array([0.3])) == 1.0
    assert wilcoxon(np.zeros(4)) == 1.0


def test_the_least_p_is_that_of_differences_of_one_sign():
    for pairs in (1, 2, 6, 15):
        assert least_p(pairs) == wilcoxon(np.arange(1.0, pairs + 1.0))
    # Six pairs, 24 tests: no corrected p is below 0.75.
    assert min(holm({str(i): least_p(6) for i in range(24)}).values()) == 0.75
    for tests in (1, 24, 72):
        pairs = pairs_needed(tests)
        enough, few = (
            min(holm({str(i): least_p(n) for i in range(tests)}).values())
            for n in (pairs, pairs - 1)
        )
        assert enough < SIGNIFICANT <= few


def mean_interval(values, strata):
    return combined_interval(values.mean(), stratified_parts(values, strata))


def test_the_interval_of_a_mean_agrees_with_student_and_welch():
    random = np.random.default_rng(5)
    one, other = random.normal(1.0, 0.2, 5), random.normal(7.0, 2.0, 5)
    ends = ttest_1samp(one, 0.0).confidence_interval(0.95)
    np.testing.assert_allclose(mean_interval(one, ["turn"] * 5), ends)
    # The mean of two paths is half the difference of one from minus the other.
    ends = ttest_ind(one, -other, equal_var=False).confidence_interval(0.95)
    both = mean_interval(np.concatenate([one, other]), ["turn"] * 5 + ["circle"] * 5)
    np.testing.assert_allclose(both, [0.5 * ends.low, 0.5 * ends.high])
    # Of one seed in a path nobody knows how another would differ.
    assert mean_interval(one, ["turn"] * 4 + ["circle"]) == (None, None)
    # Three values, or two in each of two paths, are too few.
    assert mean_interval(one[:3], ["turn"] * 3) == (None, None)
    assert mean_interval(one[:4], ["turn", "circle"] * 2) == (None, None)
    assert mean_interval(np.ones(4), ["turn"] * 4) == (1.0, 1.0)


def test_the_interval_covers_the_mean_with_two_seeds_a_path():
    random = np.random.default_rng(4)
    covered = 0
    for _ in range(400):
        low, high = mean_interval(random.normal(0.0, 1.0, 6), ["turn", "circle", "approach"] * 2)
        covered += low <= 0.0 <= high
    assert 0.92 * 400 <= covered <= 0.99 * 400


def test_pairs_are_drawn_within_their_path():
    rows = bootstrap_weights(["turn", "turn", "circle", "turn"], "x")
    np.testing.assert_allclose(rows[:, 2], 0.25)
    np.testing.assert_allclose(rows[:, [0, 1, 3]].sum(axis=1), 0.75)
    assert set(np.unique(np.round(rows[:, 0], 6))) == {0.0, 0.375, 0.75}
    np.testing.assert_array_equal(rows, bootstrap_weights(["turn", "turn", "circle", "turn"], "x"))


def test_the_bootstrap_s_variance_is_that_of_the_mean_within_paths():
    values = np.array([0.1, 0.5, 0.2, 0.9, 0.4, 5.0, 5.3, 4.6, 5.1, 4.9])
    drawn = bootstrap_weights(["turn"] * 5 + ["circle"] * 5, "x") @ values
    expected = np.mean([values[:5].var(ddof=1), values[5:].var(ddof=1)]) / 10
    assert abs(drawn.var() / expected - 1.0) < 0.1
    assert abs(drawn.mean() - values.mean()) < 0.01


def test_the_interval_has_its_nominal_coverage():
    random = np.random.default_rng(3)
    covered, paths = 0, ["turn"] * 5 + ["circle"] * 5 + ["approach"] * 5
    for _ in range(150):
        values = np.repeat([0.0, 0.5, 1.0], 5) + random.normal(0.0, 1.0, 15)
        result = paired(values, paths)
        covered += result.low <= 0.5 <= result.high
    assert 0.9 * 150 <= covered <= 149


def test_few_pairs():
    assert paired(np.zeros(0), []).mean is None
    one = paired(np.array([0.2]), ["turn"])
    assert (one.n, one.mean, one.low, one.p) == (1, 0.2, None, None)


def test_the_closed_fraction_of_a_gap():
    gap = np.array([1.0, 1.1, 0.9, 1.0])
    path = ["turn"] * 4
    assert gap_closed(gap, 0.0 * gap, path, "x").mean == 1.0
    np.testing.assert_allclose(gap_closed(gap, -0.25 * gap, path, "x").mean, 0.75)
    half = gap_closed(gap, 0.5 * gap[::-1], path, "x")
    assert half.low < half.mean == 0.5 < half.high
    assert gap_closed(gap, 2.0 * gap, path, "x").mean == -1.0
    # Too much on one path and too little on the other is 0 in the mean, and closes nothing.
    two = ["turn"] * 3 + ["circle"] * 3
    signs = np.repeat([1.0, -1.0], 3)
    np.testing.assert_allclose(gap_closed(np.ones(6), signs, two, "x").mean, 0.0)
    # What may not be there cannot be closed.
    assert gap_closed(np.array([1.0, -1.0, 0.9, -0.9]), gap, path, "x").mean is None
    assert gap_closed(gap[:1], gap[:1], path[:1], "x").mean is None
    paths = ["turn", "circle", "approach"] * 2
    few = gap_closed(np.tile(gap[:1], 6), np.tile(0.5 * gap[:1], 6), paths, "x")
    assert (few.mean, few.low, few.high) == (0.5, None, None)
