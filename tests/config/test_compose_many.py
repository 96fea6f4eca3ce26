"""The fast way to many configurations gives what the one way gives, to the message."""

import pytest

from stixel_cli.config import compose_many
from stixel_cli.config.compose import compose
from stixel_cli.config.compose_many import Composer
from stixel_cli.config.folders import group_options, outer_options
from stixel_cli.errors import ConfigurationError

OPTIONS = [(group, option) for group, options in group_options().items() for option in options]
LINES = [
    [],
    ["seed=7", "tracker.sigma_f=0.25", "rig=kitti", "rig.height=370"],
    ["road_user=cyclist", "path=waypoints", "path.speed=${pace.turn_speed}"],
    ["pace=pedestrian", "path=circle", "road_user.contrast=0.25", "pictures.frames=[0,3]"],
    ["path=waypoints", "path.points=[[0,12],[3,15.5]]", "++renderer.light.sun=1"],
    ["rig.height=${rig.width}", "measurement=fabricated", "measurement.rays=null"],
    ["measurement=fabricated", "measurement/noise=constant", "measurement.noise.range_std=1"],
    ["measurement.noise.disparity_std=0.2", "measurement=fabricated", "seed=3"],
    ["path=crossing", "road_user=pedestrian", "tracker.jitter=1e-7", "measurement='fabricated'"],
]
WRONG = [
    ["measurement/noise=constant"],
    ["measurement=fabricated", "measurement.noise=constant"],
    ["measurement=fabricated", "measurement/noise=constant", "measurement.noise.edge_metres=1"],
    ["measurement.noise.range_std=1"],
    ["path=turn", "path.swing=3"],
    ["seed=-1"],
    ["seed=a"],
    ["rig.width=${nothing.there}"],
    ["rig.width=${rig.width}"],
    ["rig.widht=3"],
    ["seed=1", "seed=2"],
    ["path.sample_time=9", "path.duration=3"],
    ["tracker.sigma_f=nan"],
    ["rig.width={a:1}"],
    ["seed=0,1"],
    ["road_user.mesh=${oc.env:NOWHERE}"],
]


def alone(group, option):
    """An option, within another group with one that has it."""
    outer = group.rpartition("/")[0]
    around = [f"{outer}={outer_options(group)[0]}"] if outer else []
    return [*around, f"{group}={option}"]


@pytest.fixture(scope="module")
def composer():
    return Composer()


@pytest.mark.parametrize("line", [*LINES, *(alone(*one) for one in OPTIONS)])
def test_it_is_what_compose_gives(line, composer, monkeypatch):
    monkeypatch.setattr(compose_many, "compose", None)  # the slow way is not needed
    fast, slow = composer.compose(line), compose(line)
    assert fast == slow
    assert list(fast.resolved) == list(slow.resolved)
    assert repr(fast.configuration) == repr(slow.configuration)


@pytest.mark.parametrize("line", WRONG)
def test_what_is_wrong_is_said_as_compose_says_it(line, composer):
    with pytest.raises(ConfigurationError) as slow:
        compose(line)
    with pytest.raises(ConfigurationError) as fast:
        composer.compose(line)
    assert str(fast.value) == str(slow.value)


@pytest.mark.parametrize(
    "line", [["road_user.contrast=${oc.decode:0.25}"], ["world.contrast='${world.contrast_}'"]]
)
def test_what_plain_dicts_cannot_do_is_left_to_compose(line, composer):
    try:
        slow = compose(line)
    except ConfigurationError as fault:
        with pytest.raises(ConfigurationError, match=str(fault)[:20]):
            composer.compose(line)
    else:
        assert composer.compose(line) == slow


def test_equal_groups_are_one_object(composer):
    one, other = composer.compose(["seed=1"]), composer.compose(["seed=2", "tracker.sigma_f=0.3"])
    assert one.configuration.rig is other.configuration.rig
    assert one.configuration.tracker is not other.configuration.tracker
    assert one.resolved["rig"] is not other.resolved["rig"]
