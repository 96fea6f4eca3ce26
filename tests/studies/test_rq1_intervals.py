"""Intervals of RQ1 count poses: neither seeds nor stixels of a pose make them shorter."""

from importlib import resources
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from stage_summaries import column_summary, coverage_summary

from stixel_cli import studies
from stixel_cli.geometry.rig import Rig
from stixel_cli.report.blocks import Material
from stixel_cli.report.statistics import Statistic
from stixel_cli.report.template import findings_of, template_of
from stixel_cli.studies.rq1 import errors as of
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1.errors import Errors, Measure, counts, errors_of
from stixel_cli.validation.stage_errors import PHASES, ZONES

RIG = Rig(64, 48, 60.0, None, None, None, 0.3, 1.2, 0.0, None)
VALUE = Measure("rows", "value")


def errors(values, seeds=1):
    """One row for each of the values, of two road users in turn, `seeds` times."""
    i = np.arange(len(values))
    poses = (i % 2) * 100_000 + i
    rows = pd.DataFrame({"pose": np.tile(poses, seeds), "value": np.tile(values, seeds)})
    return Errors({}, {"rows": rows})


def ends(one):
    return one.mean, one.low, one.high


def test_seeds_of_a_pose_count_once():
    values = np.random.default_rng(2).normal(0.3, 1.0, 24)
    one, many = (errors(values, seeds).estimate(VALUE) for seeds in (1, 10))
    assert one.mean == pytest.approx(values.mean())
    assert ends(many) == pytest.approx(ends(one))
    # As wide as the mean of 12 poses of either road user makes it.
    std = np.sqrt(0.5 * (values[::2].var(ddof=1) + values[1::2].var(ddof=1)) / 24)
    assert one.high - one.low == pytest.approx(2 * 1.96 * std, rel=0.1)


def test_rows_without_values_do_not_count():
    values = np.array([1.0, 2.0, 3.0, 4.0, np.nan, np.nan])
    assert errors(values).estimate(VALUE).mean == 2.5
    assert ends(errors(values[:0]).estimate(VALUE)) == (None, None, None)
    assert errors(values[4:]).estimate(VALUE).mean is None
    # One pose of each road user.
    assert ends(errors(values[:2]).estimate(VALUE)) == (1.5, None, None)
    assert errors(values).estimate(VALUE, least=7) == Statistic()


def test_a_difference_without_values_has_no_interval():
    one = errors(np.full(20, np.nan), 3)
    assert ends(one.less(one, VALUE)) == (None, None, None)


def test_a_difference_is_paired_by_pose():
    values = np.random.default_rng(4).normal(0.0, 5.0, 20)
    found = errors(values + 0.1, 3).less(errors(values, 2), VALUE)
    # Poses differ by far more than the pairs do.
    assert found.mean == pytest.approx(0.1)
    assert 0.09 < found.low <= found.high < 0.11
    # A pose that only one side has is left out.
    more = errors(np.append(values, 100.0))
    assert more.less(errors(values), VALUE).mean == pytest.approx(0.0)


def test_poses_that_all_agree_have_no_interval():
    assert ends(errors(np.full(12, 0.25)).estimate(VALUE)) == (0.25, None, None)


def stixels(n=0, **changes):
    """Stixels on the target in one frame."""
    names = ("true_depth", "disparity", "depth", "own_depth", "sigma")
    names += ("height", "lateral", "top", "base", "square", "slanted")
    empty = {name: np.zeros(n, bool if name in ("square", "slanted") else float) for name in names}
    frames = ("columns", "covered", "matched", "shown", "unseen")
    empty |= {name: np.zeros(1, int) for name in frames}
    return SimpleNamespace(**empty | {"overhang": np.zeros((1, 2)), "offsets": [0, n]} | changes)


def record(of_stixels, depth, columns=None):
    """Stage errors of frames at depths, without disparities."""
    shape = (len(depth), len(ZONES))
    sums = dict.fromkeys(("pixels", "valid", "gross", "total", "squares"), np.zeros(shape))
    phases = dict.fromkeys(("phase_total", "phase_count"), np.zeros((*shape, PHASES)))
    disparity = SimpleNamespace(**sums, **phases, histogram=np.zeros((*shape, 4)))
    return SimpleNamespace(
        first=0, target_depth=depth, disparity=disparity, columns=columns, stixels=of_stixels
    )


def study_run(*records, user="car", seed=0):
    configuration = SimpleNamespace(road_user=SimpleNamespace(kind=user), rig=RIG)
    return SimpleNamespace(configuration=configuration, load=lambda _: records, seed=seed)


def test_stixels_exclude_gross_errors_and_other_ranges():
    made = stixels(
        5,
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
        overhang=np.zeros((3, 2)),
        **dict.fromkeys(("columns", "covered", "matched", "shown", "unseen"), np.zeros(3, int)),
    )
    found = errors_of([study_run(record(made, np.full(3, 10.0)))]).between(5.0, 50.0)
    assert found.tables["stixels"]["pose"].tolist() == [0, 2, 2]
    expected = {
        of.BIAS: (0.5 + 1.0 - 2.0) / 3,
        of.RMS: np.sqrt((0.25 + 1.0 + 4.0) / 3),
        of.RMS_PX: np.sqrt((0.01 + 0.04 + 0.04) / 3),
        # Depth errors of 1, 0.5 and -1.25 of what the stixels state.
        of.NEES: (1.0 + 0.25 + 1.5625) / 3,
        of.WITHIN_1: 2 / 3,
        of.WITHIN_2: 1.0,
        of.SIGMA: (0.5 + 2.0 + 1.6) / 3,
        of.bias("height"): 0.4 / 3,
        of.rms("height"): np.sqrt((0.09 + 0.01 + 0.04) / 3),
        of.bias("square"): 0.4,
        of.rms("square"): 0.4,
        of.bias("slanted"): 1.0,
        of.rms("slanted"): 1.0,
        of.rms("lateral"): 0.1,
        of.bias("top"): -2.0,
        of.rms("top"): 2.0,
        of.bias("base"): 3.0,
        of.rms("base"): 3.0,
        of.STIXEL_GROSS: 0.25,
    }
    for measure, value in expected.items():
        assert found.estimate(measure).mean == pytest.approx(value), measure


def seen_errors(frames=8, columns=30):
    """Frames of two road users from 6 to 20 m, with columns and coverage at random."""
    random = np.random.default_rng(3)
    true = random.choice([np.nan, 10.0, 20.0], (frames, columns))
    found = np.where(
        random.random(true.shape) < 0.1, np.nan, true + random.normal(0, 1, true.shape)
    )
    there = random.random(true.shape) < 0.5
    of_target = np.isfinite(true)
    of_target[:, :3] = False
    covered = np.full(frames, 9)
    cover = stixels(
        4 * frames,
        offsets=4 * np.arange(frames + 1),
        columns=np.full(frames, 10),
        covered=covered,
        matched=covered - np.arange(frames) % 3,
        overhang=random.integers(0, 3, (frames, 2)),
        hanging=np.zeros(frames),
        shown=np.full(frames, 12),
        unseen=random.integers(0, 4, frames),
        sigma=np.ones(4 * frames),
    )
    image = {"of_target": of_target, "true": true, "path": found, "path_there": there}
    image |= {"grid": found, "grid_there": there}
    return record(cover, np.linspace(6.0, 20.0, frames), SimpleNamespace(**image))


def test_estimates_are_equal_to_the_summaries():
    made = seen_errors()
    chosen = (made.target_depth >= 5.0) & (made.target_depth < 15.0)
    own = errors_of([study_run(made)], "all").between(5.0, 15.0)
    columns = made.columns
    named = {
        "bias": ("px", False), "rms": ("px", True), "bias_m": ("m", False), "rms_m": ("m", True),
        "missed": ("missed", False), "below_threshold": ("below threshold", False),
        "false_positive": ("false positive", False),
    }  # fmt: skip
    every = np.broadcast_to(chosen[:, None], columns.true.shape)
    for all_, mask in ((True, every), (False, columns.of_target & chosen[:, None])):
        values = (columns.true[mask], columns.path[mask], columns.path_there[mask])
        summary = column_summary(*values, RIG)
        for name, (value, root) in named.items():
            found = own.estimate(of.of_columns(value, "path", root, all_))
            assert found.mean == pytest.approx(summary[name]), name
            assert found.low < found.mean < found.high
    # Rows of the target's columns only have the same measures of the target.
    fewer = errors_of([study_run(made)], "target").between(5.0, 15.0)
    measure = of.of_columns("missed")
    assert fewer.estimate(measure) == own.estimate(measure)
    cover = coverage_summary(made.stixels, chosen)
    named = {
        "missed": of.UNCOVERED, "elsewhere": of.ELSEWHERE, "stixels": of.STIXELS_A_FRAME,
        "overhang": of.OVERHANG, "unseen": of.UNSEEN,
    }  # fmt: skip
    for name, measure in named.items():
        assert own.estimate(measure).mean == pytest.approx(cover[name]), name


def test_parts_have_their_own_runs_and_rows():
    runs = [study_run(seen_errors(), user=user, seed=i) for i, user in enumerate(("car", "tram"))]
    runs.append(study_run(seen_errors(), user="car", seed=2))
    car, tram = errors_of(runs).by(of.road_user)
    assert (car.label, tram.label) == ("car", "tram")
    assert [run.seed for run in car.runs.values()] == [0, 2]
    assert len(car.tables["frames"]) == 2 * len(tram.tables["frames"]) == 16
    assert set(car.tables["frames"]["run"]) == {0, 2} and set(tram.tables["frames"]["run"]) == {1}
    assert counts([car, tram]) == "8 poses per line, 1 to 2 seeds per pose"
    near = car.between(6.0, 9.0)
    assert counts([near]) == "2 poses per line, 2 seeds per pose"


def test_only_the_first_line_of_a_group_has_a_band():
    own = errors_of([study_run(seen_errors())])
    measures = (of.UNCOVERED, of.ELSEWHERE)
    one, two = (
        figures.over_range("a", [own], [("Title", "m", drawn)], least=1).svg.decode()
        for drawn in ({"": of.UNCOVERED}, dict(zip(("full", "dashed"), measures, strict=True)))
    )
    assert one.count('id="FillBetweenPolyCollection') == 1
    assert two.count('id="FillBetweenPolyCollection') == 1


def test_the_answer_begins_with_a_sentence_for_each_class():
    text = (resources.files(studies) / "templates/rq1.md.j2").read_text("utf-8")
    definitions, sentences = text.index("{% if near %}"), text.index("{% for label")
    of_classes = text[:definitions] + text[sentences : text.index("{% if forest %}")]
    template = template_of(of_classes, "rq1")
    values = {"near": True, "forest": None, "of": of}
    car = ("car", Statistic(0.42, 0.35, 0.5), Statistic(-0.1, -0.2, 0.0))
    leads = [car, ("cyclist", Statistic(), Statistic())]
    said = findings_of(template, Material(values | {"leads": leads}), "rq1").answer
    assert said[0] == (
        "Car: RMS depth error 0.420\u202fm [0.350, 0.500], bias −0.10\u202fm [−0.20, 0.00], "
        "between 25 and 31 m; The Stixel World states 0.1 m at 28 m."
    )
    assert said[1].startswith("Cyclist: RMS depth error –, bias –")
    without = findings_of(template, Material(values | {"leads": leads, "near": None}), "rq1")
    assert without.answer == ()
