"""Values set in plain dicts give the same configurations as OmegaConf."""

import pytest
from omegaconf import OmegaConf

from stixel_cli.border import TYPED
from stixel_cli.config import choice
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import conf_state, group_options, outer_options
from stixel_cli.config.overrides import read_overrides

OPTIONS = [
    (group, option)
    for group, options in group_options().items()
    for option in options
    # A recording and a track need files, see tests/recordings.
    if group != "source" and (group, option) not in {("path", "recorded"), ("tracker", "file")}
]
LINES = [
    [],
    ["seed=7", "tracker.sigma_f=0.25", "rig=kitti", "rig.height=370"],
    ["road_user=cyclist", "path=waypoints", "path.speed=${pace.turn_speed}"],
    ["pace=pedestrian", "path=circle", "road_user.contrast=0.25", "pictures.frames=[0,3]"],
    ["path=waypoints", "path.points=[[0,12],[3,15.5]]", "++sensor.read_noise=1"],
    ["rig.height=${rig.width}", "measurement=fabricated", "measurement.rays=null"],
    ["measurement=fabricated", "measurement/noise=constant", "measurement.noise.range_std=1"],
    ["measurement.noise.disparity_std=0.2", "measurement=fabricated", "seed=3"],
    ["path=crossing", "road_user=pedestrian", "tracker.jitter=1e-7", "measurement='fabricated'"],
]


def alone(group, option):
    """An option, within another group with one that has it."""
    outer = group.rpartition("/")[0]
    around = [f"{outer}={outer_options(group)[0]}"] if outer else []
    return [*around, f"{group}={option}"]


def typed(line):
    return read_overrides(line, TYPED)


@pytest.fixture(scope="module")
def composer():
    return Composer()


@pytest.mark.parametrize("line", [*LINES, *(alone(*one) for one in OPTIONS)])
def test_equal_to_omegaconf(line, monkeypatch):
    settings = {one.key: one.value for one in typed(line)}
    options = tuple(sorted((k, v) for k, v in settings.items() if k in group_options()))
    values = {key: value for key, value in settings.items() if key not in group_options()}
    plain = choice.compose_options(options, conf_state()).plain
    fast = choice.with_values(plain, values)
    monkeypatch.setattr(choice, "_resolved", lambda section, *_: section)
    tree = OmegaConf.create(choice.with_values(plain, values))
    slow = OmegaConf.to_container(tree, resolve=True, throw_on_missing=True)
    assert fast == slow and repr(fast) == repr(slow)


def test_equal_groups_are_one_object(composer):
    lines = ["seed=1"], ["seed=2", "tracker.sigma_f=0.3"]
    one, other = (composer.compose(typed(line)) for line in lines)
    assert one.configuration.rig is other.configuration.rig
    assert one.configuration.tracker is not other.configuration.tracker
    assert one.resolved["rig"] is other.resolved["rig"]
