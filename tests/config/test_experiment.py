"""The group `experiment`: one option sets options and values of many groups."""

import shutil

import pytest
import yaml

from stixel_cli.config import folders
from stixel_cli.config.compose import compose
from stixel_cli.config.experiments import experiment_sources
from stixel_cli.config.folders import EXPERIMENT, group_options, shipped_folder
from stixel_cli.config.keys import known_keys
from stixel_cli.errors import ConfigurationError

CLASSES = group_options()["road_user"]
SOURCES = ("thesis", "paper", "ours")


def thesis(*overrides):
    return compose(["experiment=thesis", *overrides])


def file_of(option):
    text = (shipped_folder("conf") / EXPERIMENT / f"{option}.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text) or {}


def flatten(plain, prefix=""):
    for key, value in plain.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}"


@pytest.fixture
def own_conf(tmp_path, monkeypatch):
    """A checkout of the user's own: its folder of experiments."""
    shutil.copytree(shipped_folder("conf"), tmp_path / "conf")
    (tmp_path / "pyproject.toml").touch()
    monkeypatch.setattr(folders, "_PACKAGE", tmp_path / "stixel_cli")
    group_options.cache_clear()
    yield tmp_path / "conf" / EXPERIMENT
    group_options.cache_clear()


def test_by_default_there_is_no_experiment():
    default, chosen = compose([]), compose(["experiment=none"])
    assert default.choices == chosen.choices and default.choices[EXPERIMENT] == "none"
    assert default.configuration == chosen.configuration
    assert default.resolved == chosen.resolved and EXPERIMENT not in default.resolved


@pytest.mark.parametrize("road_user", CLASSES)
def test_the_thesis_sets_values_of_several_groups_for_every_class(road_user):
    composition = thesis(f"road_user={road_user}")
    chosen = composition.configuration
    assert chosen.extraction.width == 1
    assert (chosen.tracker.sigma_f, chosen.tracker.sigma_r) == (2.0, 0.8)
    assert chosen.tracker.measurement_std == 0.1
    assert (chosen.start.position, chosen.start.heading) == (0.3, 0.1)
    assert (chosen.start.rates, chosen.start.heading_rate) == ("zero", 0.5)
    assert chosen.start.velocity == chosen.pace.speed
    assert composition.choices | {EXPERIMENT: "thesis", "prior": road_user} == composition.choices


@pytest.mark.parametrize("road_user", CLASSES)
def test_its_fabricated_noise_is_constant(road_user):
    composition = thesis("measurement=fabricated", f"road_user={road_user}")
    measurement = composition.configuration.measurement
    assert composition.choices["measurement/noise"] == "constant"
    assert (measurement.noise.kind, measurement.noise.range_std) == ("constant", 0.1)
    assert (measurement.rays, measurement.spacing) == (None, "angle")


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


@pytest.mark.parametrize("option", [o for o in group_options()[EXPERIMENT] if o != "none"])
@pytest.mark.parametrize(
    ("group", "other"),
    [
        (g, o)
        for g, options in group_options().items()
        for o in options
        if g not in (EXPERIMENT, "source") and (g, o) != ("path", "recorded")  # needs a folder
    ],
)
def test_values_of_keys_that_another_option_lacks_are_left_out(option, group, other):
    outer = ["measurement=fabricated"] if group == "measurement/noise" else []
    composition = compose([f"experiment={option}", *outer, f"{group}={other}"])
    assert composition.choices[group] == other


def test_values_of_the_users_own_experiment(own_conf):
    (own_conf / "mine.yaml").write_text(
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
    (own_conf / "mine.yaml").write_text(f"# @package _global_\n{content}\n")
    group_options.cache_clear()
    with pytest.raises(ConfigurationError, match=named) as fault:
        compose(["experiment=mine", "measurement=fabricated"])
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize("option", [o for o in group_options()[EXPERIMENT] if o != "none"])
def test_every_choice_and_value_has_a_source(option):
    content, sources = file_of(option), experiment_sources(option)
    choices = [
        name.removeprefix("override /")
        for one in content.pop("defaults", [])
        if isinstance(one, dict)
        for name in one
    ]
    choices += content.pop("inner_options", {})
    content.pop("sources", None)
    # Every key of a group that has an option of its own for the experiment is written in it.
    expected = {*choices, *flatten(content)}
    given = {one for one in expected if one in sources or f"{one}.rates" in sources}
    assert expected == given
    for name, source in sources.items():
        assert name in group_options() or name in known_keys()
        assert source.split(",")[0].split(" (")[0] in SOURCES, name
