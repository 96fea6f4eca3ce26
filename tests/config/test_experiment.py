"""The group `experiment`: one option sets options and values of many groups."""

import itertools
import re

import numpy as np
import pytest
import yaml
from test_folders import flatten

from stixel_cli.config.choice import set_by_experiment
from stixel_cli.config.compose import compose
from stixel_cli.config.folders import EXPERIMENT, group_options, option_values, shipped_folder
from stixel_cli.config.keys import known_keys
from stixel_cli.errors import ConfigurationError
from stixel_cli.tracking.prior import prior_radii

CLASSES = group_options()["road_user"]
SOURCES = ("thesis", "paper", "ours")


def thesis(*overrides):
    return compose(["experiment=thesis", *overrides])


def file_of(option):
    text = (shipped_folder("conf") / EXPERIMENT / f"{option}.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text) or {}


def test_by_default_there_is_no_experiment():
    default, chosen = compose([]), compose(["experiment=none"])
    assert default.choices == chosen.choices and default.choices[EXPERIMENT] == "none"
    assert default.configuration == chosen.configuration
    assert default.resolved == chosen.resolved and EXPERIMENT not in default.resolved


@pytest.mark.parametrize("road_user", CLASSES)
def test_the_thesis_sets_plain_values_of_several_groups_for_every_class(road_user):
    composition = thesis(f"road_user={road_user}")
    chosen = composition.configuration
    assert chosen.extraction.width == 1
    assert (chosen.tracker.sigma_f, chosen.tracker.sigma_r) == (2.0, 0.8)
    assert chosen.tracker.measurement_std == 0.1
    assert (chosen.start.position, chosen.start.heading) == (0.3, 0.1)
    assert (chosen.start.rates, chosen.start.heading_rate) == ("zero", 0.5)
    pace = option_values("pace", road_user)
    assert chosen.start.velocity == pace["speed"]
    assert composition.choices | {EXPERIMENT: "thesis", "prior": road_user} == composition.choices
    chosen = thesis(f"road_user={road_user}").configuration
    assert chosen.prior.shape == "none" and not prior_radii(chosen.prior, np.arange(6.0)).any()
    assert chosen.stereo.subpixel == "parabola"
    assert chosen.extraction.refinement == chosen.height.hidden_rows == 0
    rig, nearest = chosen.rig, chosen.stereo.nearest
    assert chosen.extraction.front_margin > rig.focal * rig.baseline / nearest
    composition = thesis("measurement=fabricated", f"road_user={road_user}")
    measurement = composition.configuration.measurement
    assert composition.choices["measurement/noise"] == "constant"
    assert (measurement.noise.kind, measurement.noise.range_std) == ("constant", 0.1)
    assert (measurement.rays, measurement.spacing) == (None, "angle")


@pytest.mark.parametrize("road_user", CLASSES)
def test_the_improved_thesis_differs_by_the_improvements(road_user):
    default = compose([f"road_user={road_user}", "measurement=fabricated"])
    improved = compose([*default.overrides, "experiment=thesis_improved"])
    changed = {
        key
        for key in dict(flatten(default.resolved)).keys() & dict(flatten(improved.resolved)).keys()
        if default.value(key) != improved.value(key)
    }
    fabricated = {"measurement.spacing", "measurement.noise.kind"}
    start = {"start.rates", "start.position", "start.velocity", "start.heading_rate"}
    assert changed <= fabricated | start


METHOD = (
    *("stereo", "road", "occupancy", "free_space", "height", "extraction", "measurement"),
    *("start", "tracker"),
)
OWN = {"stereo/sgm_thesis", "start/zero_rates", "tracker/gp_ekf_thesis"}
"""Presets that are of this experiment alone."""


def plain_thesis(*overrides):
    composed = compose(["experiment=thesis", *overrides])
    return {name: composed.resolved[name] for name in METHOD} | {
        "shape": composed.value("prior.shape"),
        "options": {name: composed.choices[name] for name in METHOD},
    }


def changed_defaults(conf):
    """Other options by default, and another value of each number in the presets of the method.

    Returns the groups whose presets have changed.
    """
    file = conf / "config.yaml"
    text = file.read_text(encoding="utf-8")
    others = {
        group: next(o for o in group_options()[group] if f"- {group}: {o} " not in f"{text} ")
        for group in METHOD
        if len(group_options()[group]) > 1
    }
    others |= {"tracker": "contour", "start": "scans", "measurement": "lidar", "stereo": "bm"}
    for group, option in others.items():
        text, count = re.subn(rf"^  - {group}: \w+", f"  - {group}: {option}", text, flags=re.M)
        assert count == 1
    file.write_text(text, encoding="utf-8")
    changed = set()
    for path in itertools.chain(*((conf / g).rglob("*.yaml") for g in (*METHOD, "prior"))):
        name = path.relative_to(conf).with_suffix("").as_posix()
        if name not in OWN:
            lines = path.read_text(encoding="utf-8")
            other = re.sub(r"(?<=: )(\d+\.\d+)", lambda m: str(1.01 * float(m[1]) + 0.01), lines)
            other = re.sub(r"(?<=: )(\d+)(?![\d.])", lambda m: str(int(m[1]) + 2), other)
            path.write_text(other.replace("phase_table", "parabola"), encoding="utf-8")
            changed |= {name.partition("/")[0]} if other != lines else set()
    return changed


@pytest.mark.parametrize("measurement", [(), ("measurement=fabricated",)], ids=len)
def test_no_default_changes_the_thesis(measurement, own_conf):
    before = plain_thesis(*measurement)
    assert changed_defaults(own_conf) == {*METHOD, "prior"}
    group_options.cache_clear()
    assert plain_thesis(*measurement) == before


def test_its_stereo_noise_is_a_tenth_of_a_metre_at_28_metres():
    measured = thesis("measurement=fabricated", "measurement/noise=stereo").configuration
    noise, rig = measured.measurement.noise, measured.rig
    assert noise.kind == "stereo"
    assert 28.0**2 * noise.disparity_std / (rig.focal * rig.baseline) == pytest.approx(0.1, 1e-3)


@pytest.mark.parametrize(
    ("override", "key", "value"),
    [
        ("tracker.sigma_f=0.5", "tracker.sigma_f", 0.5),
        ("tracker.sigma_f=${prior.sigma_f}", "tracker.sigma_f", 0.1),
        ("start.velocity=1", "start.velocity", 1),
        ("start=default", "start.rates", "truth"),
        ("stereo=bm", "stereo", "bm"),
        ("rig=kitti", "rig.width", 1242),
        ("occupancy=cartesian", "occupancy.kind", "cartesian"),
        ("pace=cyclist", "start.velocity", 4.0),
    ],
)
def test_it_stays_open_to_overrides(override, key, value):
    assert thesis(override).value(key) == value
    assert compose([override, "experiment=thesis"]).value(key) == value


EXPERIMENTS = [option for option in group_options()[EXPERIMENT] if option != "none"]


def others_of(experiment):
    """Group and option, of each kind in the groups in which the experiment sets anything."""
    groups = {name.partition(".")[0] for name in set_by_experiment(experiment)}
    for group in group_options():
        of_kind = {}
        for option in group_options()[group] if group in groups else ():
            kind = option_values(group, option).get("kind", "")
            # It needs a file.
            if (group, kind) != ("tracker", "file"):
                of_kind.setdefault(kind, option)
        yield from ((group, option) for option in of_kind.values())


TRIED = {other: experiment for experiment in EXPERIMENTS for other in others_of(experiment)}
"""Group and option to one of the experiments: what is left out follows from the keys alone."""


@pytest.mark.parametrize(("group", "other", "option"), [(*o, e) for o, e in TRIED.items()])
def test_values_of_keys_that_another_option_lacks_are_left_out(group, other, option):
    outer = ["measurement=fabricated"] if group == "measurement/noise" else []
    if group == "tracker" and other not in ("box", "contour", "gp_ekf", "gp_ekf_thesis", "no_data"):
        outer = ["prior.shape=ellipse"]  # refused without one: test_overrides.py
    composition = compose([f"experiment={option}", *outer, f"{group}={other}"])
    assert composition.choices[group] == other


def test_values_of_the_users_own_experiment(own_conf):
    (own_conf / EXPERIMENT / "mine.yaml").write_text(
        "# @package _global_\n"
        "defaults: [thesis, override /road_user: cyclist, _self_]\n"
        "seed: 7\ntracker: {sigma_f: 0.4}\n"
    )
    group_options.cache_clear()
    composition = compose(["experiment=mine", "path=crossing"])
    assert composition.choices["prior"] == "cyclist"
    assert composition.choices["path"] == "crossing"
    assert composition.configuration.seed == 7
    tracker = composition.configuration.tracker
    assert (tracker.sigma_f, tracker.sigma_r) == (0.4, 0.8)
    assert compose(["experiment=mine", "seed=2"]).configuration.seed == 2


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("tracker: {sigma_g: 1}", "tracker.sigma_g"),
        ("trakcer: {sigma_f: 1}", "trakcer"),
        ("tracker: {sigma_f: -1}", "tracker.sigma_f"),
        ("tracker: {sigma_f: much}", "tracker.sigma_f"),
        ("tracker: 3", "tracker"),
        ("- 1", "mine"),
        ("defaults: [override /path: nowhere]", "nowhere"),
        ("measurement: {kind: fabricated}\ninner_options: {measurement/noise: nothing}", "noise"),
        ("inner_options: {measurement/noise: nothing}", "nothing"),
        ("inner_options: 3", "inner_options"),
    ],
)
def test_a_fault_in_an_experiment_is_one_line(content, named, own_conf):
    (own_conf / EXPERIMENT / "mine.yaml").write_text(f"# @package _global_\n{content}\n")
    group_options.cache_clear()
    around = ["measurement=fabricated"] if "measurement" in content else []
    with pytest.raises(ConfigurationError, match=named) as fault:
        compose(["experiment=mine", *around])
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize("option", EXPERIMENTS)
def test_every_choice_and_value_has_a_source(option):
    content = file_of(option)
    sources = content.get("sources", {})
    choices = [
        name.removeprefix("override /")
        for one in content.pop("defaults", [])
        if isinstance(one, dict)
        for name in one
    ]
    choices += content.pop("inner_options", {})
    content.pop("sources", None)
    # Every key of a group that has an option of its own for the experiment is written in it.
    expected = {*choices, *dict(flatten(content))}
    given = {
        one
        for one in expected
        if one in sources or f"{one}.rates" in sources or one.partition(".")[0] in sources
    }
    assert expected == given
    for name, source in sources.items():
        assert name in group_options() or name in known_keys()
        assert source.split(",")[0].split(" (")[0] in SOURCES, name
