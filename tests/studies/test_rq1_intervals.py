"""Intervals of RQ1 count poses: neither seeds nor stixels of a pose make them shorter."""

from dataclasses import replace
from importlib import resources
from types import SimpleNamespace

import numpy as np
import pytest
from stage_summaries import column_summary, coverage_summary

from stixel_cli import studies
from stixel_cli.geometry.rig import Rig
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1.intervals import (
    BASE_BIAS,
    BASE_RMS,
    COLUMN_BELOW_THRESHOLD,
    COLUMN_BIAS,
    COLUMN_BIAS_M,
    COLUMN_FALSE_POSITIVE,
    COLUMN_MISSED,
    COLUMN_RMS,
    COLUMN_RMS_M,
    ELSEWHERE,
    HEIGHT_BIAS,
    HEIGHT_RMS,
    LATERAL_RMS,
    NEES,
    NONE,
    OVERHANG,
    SLANTED_BIAS,
    SLANTED_RMS,
    SQUARE_BIAS,
    SQUARE_RMS,
    STIXEL_BIAS,
    STIXEL_RMS,
    STIXEL_RMS_PX,
    STIXELS_A_FRAME,
    TOP_BIAS,
    TOP_RMS,
    UNCOVERED,
    UNSEEN,
    WITHIN_1,
    WITHIN_2,
    Estimate,
    column_sums,
    cover_sums,
    difference,
    estimate,
    gross_sums,
    over_range,
    ratio,
    stixel_sums,
)
from stixel_cli.studies.rq1.pool import Group, counts
from stixel_cli.studies.template import findings_of, template_of
from stixel_cli.studies.types import Material


def group(values, seeds=1):
    """Sums (count, total) of frames with the values, of two road users in turn, `seeds` times."""
    poses = np.tile(np.arange(len(values)), seeds)
    made = SimpleNamespace(
        poses=poses,
        pose_strata=tuple(("car", "cyclist")[i % 2] for i in range(len(values))),
        pose_frames=tuple(range(len(values))),
    )
    sums = np.stack([np.ones(len(poses)), np.tile(values, seeds)], axis=-1)
    return made, sums


def test_seeds_of_a_pose_count_once():
    values = np.random.default_rng(2).normal(0.3, 1.0, 24)
    one, many = (estimate(*group(values, seeds), ratio(1)) for seeds in (1, 10))
    assert one.value == pytest.approx(values.mean())
    assert (many.value, many.low, many.high) == pytest.approx((one.value, one.low, one.high))
    # As wide as the mean of 12 poses of either road user makes it.
    std = np.sqrt(0.5 * (values[::2].var(ddof=1) + values[1::2].var(ddof=1)) / 24)
    assert one.high - one.low == pytest.approx(2 * 1.96 * std, rel=0.1)


def test_frames_without_values_do_not_count():
    made, sums = group(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    sums[4:] = 0.0
    assert estimate(made, sums, ratio(1)).value == 2.5
    assert np.isnan(estimate(made, 0.0 * sums, ratio(1)).value)
    sums[2:] = 0.0
    alone = estimate(made, sums, ratio(1))
    assert alone.value == 1.5 and np.isnan(alone.low)
    assert alone.text("m") == "1.50\u202fm" and alone.cells == (1.5, None, None)


def test_a_difference_without_values_has_no_interval():
    (one, sums), (other, _) = group(np.zeros(20), 3), group(np.zeros(20), 3)
    found = difference(one, other, lambda side: 0.0 * sums, ratio(1))
    assert np.isnan([found.value, found.low, found.high]).all()


def test_a_difference_is_paired_by_pose():
    values = np.random.default_rng(4).normal(0.0, 5.0, 20)
    (one, sums_one), (other, sums_other) = group(values + 0.1, 3), group(values, 2)
    sums = {id(one): sums_one, id(other): sums_other}
    found = difference(one, other, lambda side: sums[id(side)], ratio(1))
    # Poses differ by far more than the pairs do.
    assert found.value == pytest.approx(0.1)
    assert 0.09 < found.low <= found.high < 0.11


def test_poses_that_all_agree_have_no_interval():
    found = estimate(*group(np.full(12, 0.25)), ratio(1))
    assert found.cells == (0.25, None, None)


def test_sums_of_stixels_exclude_gross_errors_and_other_ranges():
    errors = SimpleNamespace(
        offsets=np.array([0, 2, 2, 5]),
        true_depth=np.array([10.0, 60.0, 20.0, 20.0, 20.0]),
        disparity=np.array([0.1, 0.1, 3.0, 0.2, -0.2]),
        depth=np.array([0.5, 9.0, 9.0, 1.0, -2.0]),
        own_depth=np.array([0.4, 9.0, 9.0, np.nan, 1.0]),
        square=np.array([True, True, True, False, False]),
        slanted=np.array([False, False, False, False, True]),
        sigma=np.array([0.5, 1.0, 1.0, 2.0, 1.6]),
        height=np.array([0.3, 9.0, 9.0, -0.1, 0.2]),
        lateral=np.full(5, 0.1),
        top=np.full(5, -2.0),
        base=np.full(5, 3.0),
    )
    made = SimpleNamespace(errors=SimpleNamespace(stixels=errors))
    sums = stixel_sums(made, 5.0, 50.0)
    assert sums[:, 0].tolist() == [1.0, 0.0, 2.0]
    total = sums.sum(axis=0)
    assert STIXEL_BIAS(total) == pytest.approx((0.5 + 1.0 - 2.0) / 3)
    assert STIXEL_RMS(total) == pytest.approx(np.sqrt((0.25 + 1.0 + 4.0) / 3))
    assert STIXEL_RMS_PX(total) == pytest.approx(np.sqrt((0.01 + 0.04 + 0.04) / 3))
    # Depth errors of 1, 0.5 and -1.25 of what the stixels state.
    assert NEES(total) == pytest.approx((1.0 + 0.25 + 1.5625) / 3)
    assert (WITHIN_1(total), WITHIN_2(total)) == pytest.approx((2 / 3, 1.0))
    assert HEIGHT_BIAS(total) == pytest.approx(0.4 / 3)
    assert HEIGHT_RMS(total) == pytest.approx(np.sqrt((0.09 + 0.01 + 0.04) / 3))
    assert (SQUARE_BIAS(total), SQUARE_RMS(total)) == pytest.approx((0.4, 0.4))
    assert (SLANTED_BIAS(total), SLANTED_RMS(total)) == pytest.approx((1.0, 1.0))
    assert LATERAL_RMS(total) == pytest.approx(0.1)
    assert (TOP_BIAS(total), TOP_RMS(total), BASE_RMS(total)) == pytest.approx((-2.0, 2.0, 3.0))
    assert (total[4], total[17]) == (1.0, 1.0)
    assert BASE_BIAS(total) == pytest.approx(3.0)
    assert gross_sums(made, 5.0, 50.0).tolist() == [[1.0, 0.0], [0.0, 0.0], [3.0, 1.0]]


def seen_group(frames=8, columns=30):
    """Frames of two road users from 6 to 20 m, with columns and coverage at random."""
    random = np.random.default_rng(3)
    true = random.choice([np.nan, 10.0, 20.0], (frames, columns))
    found = np.where(
        random.random(true.shape) < 0.1, np.nan, true + random.normal(0, 1, true.shape)
    )
    there = random.random(true.shape) < 0.5
    covered = np.full(frames, 9)
    errors = SimpleNamespace(
        target_depth=np.linspace(6.0, 20.0, frames),
        columns=SimpleNamespace(
            of_target=np.isfinite(true), true=true, path=found, path_there=there
        ),
        stixels=SimpleNamespace(
            offsets=4 * np.arange(frames + 1),
            columns=np.full(frames, 10),
            covered=covered,
            matched=covered - np.arange(frames) % 3,
            overhang=random.integers(0, 3, (frames, 2)),
            hanging=np.zeros(frames),
            shown=np.full(frames, 12),
            unseen=random.integers(0, 4, frames),
        ),
    )
    return Group(
        label="all",
        rig=Rig(64, 48, 60.0, None, None, None, 0.3, 1.2, 0.0, None),
        runs=(),
        errors=errors,
        poses=np.arange(frames),
        pose_strata=("car", "cyclist") * (frames // 2),
        pose_frames=tuple(range(frames)),
    )


def test_estimates_are_equal_to_the_summaries():
    made = seen_group()
    chosen = made.frames(5.0, 15.0)
    of = made.errors.columns
    of.of_target[:, :3] = False
    named = {
        "bias": COLUMN_BIAS, "rms": COLUMN_RMS, "bias_m": COLUMN_BIAS_M, "rms_m": COLUMN_RMS_M,
        "missed": COLUMN_MISSED, "below_threshold": COLUMN_BELOW_THRESHOLD,
        "false_positive": COLUMN_FALSE_POSITIVE,
    }  # fmt: skip
    every = np.broadcast_to(chosen[:, None], of.true.shape)
    summary = column_summary(of.true[every], of.path[every], of.path_there[every], made.rig)
    for name, statistic in named.items():
        sums = column_sums(made, "path", 5.0, 15.0, of_target=False)
        assert estimate(made, sums, statistic).value == pytest.approx(summary[name]), name
    mask = of.of_target & chosen[:, None]
    summary = column_summary(of.true[mask], of.path[mask], of.path_there[mask], made.rig)
    for name, statistic in list(named.items())[:5]:
        found = over_range(lambda g, low, high: column_sums(g, "path", low, high), statistic)(
            made, 5.0, 15.0
        )
        assert found.value == pytest.approx(summary[name]), name
        assert found.low < found.value < found.high
    cover = coverage_summary(made.errors.stixels, chosen)
    named = {
        "missed": UNCOVERED, "elsewhere": ELSEWHERE, "stixels": STIXELS_A_FRAME,
        "overhang": OVERHANG, "unseen": UNSEEN,
    }  # fmt: skip
    for name, statistic in named.items():
        assert over_range(cover_sums, statistic, 1)(made, 5.0, 15.0).value == cover[name], name
    # Too little to be drawn.
    assert np.isnan(over_range(cover_sums, OVERHANG)(made, 5.0, 9.0).value)


def test_only_the_first_line_of_a_group_has_a_band():
    made = seen_group()

    def values(group, low, high):
        return Estimate(0.5, 0.3, 0.8) if low < 20.0 else NONE

    one, two = (
        figures.over_range("a", [made], [("Title", "m", drawn)]).svg.decode()
        for drawn in ({"": values}, {"full": values, "dashed": values})
    )
    assert one.count('id="FillBetweenPolyCollection') == 1
    assert two.count('id="FillBetweenPolyCollection') == 1


def test_a_caption_has_the_numbers_of_poses_and_seeds():
    made = seen_group()
    points = tuple(SimpleNamespace(seed=seed) for seed in (0, 1, 2))
    few = replace(made, runs=points[:1], poses=np.zeros(8, int))
    made = replace(made, runs=points)
    assert counts([made, made]) == "8 poses per line, 3 seeds per pose"
    assert counts([made, few]) == "1 to 8 poses per line, 1 to 3 seeds per pose"


def test_shares_are_shown_in_per_cent():
    assert Estimate(0.1234, 0.11, 0.14).share() == "12.3\u202f% [11.0, 14.0]"


def test_the_answer_begins_with_a_sentence_for_each_class():
    text = (resources.files(studies) / "templates/rq1.md.j2").read_text("utf-8")
    template = template_of(text.partition("{% if near %}")[0], "rq1")
    values = {"near": True, "forest": None, "std": 0.1, "depth": 28.0, "round": (25.0, 31.0)}
    leads = [("car", Estimate(0.42, 0.35, 0.5), Estimate(-0.1, -0.2, 0.0)), ("cyclist", NONE, NONE)]
    said = findings_of(template, Material(values | {"leads": leads}), "rq1").answer
    assert said[0] == (
        "Car: RMS depth error 0.420\u202fm [0.350, 0.500], bias −0.10\u202fm [−0.20, 0.00], "
        "between 25 and 31 m; The Stixel World states 0.1 m at 28 m."
    )
    assert said[1].startswith("Cyclist: RMS depth error –, bias –")
    without = findings_of(template, Material(values | {"leads": leads, "near": None}), "rq1")
    assert without.answer == ()
