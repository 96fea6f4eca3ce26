"""Overrides: parsed in one place, equal to what OmegaConf gives, and the impossible refused."""

from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

import stixel_cli
from stixel_cli.border.origins import TYPED
from stixel_cli.config import choice, overrides
from stixel_cli.config.compose import Composer, compose
from stixel_cli.config.folders import conf_state, group_options, outer_options, outermost_group
from stixel_cli.config.overrides import parse, read_overrides
from stixel_cli.errors import ConfigurationError

PLAIN = ["seed=3", "path.speed=-0.25", "a.b_c.d2=12.50", "x=-0", "x=0.0", "path=turn"]
PLAIN += ["measurement/noise=fitted_2", "road.kind=_x9", "x=1234567890123456", "x=nan_", "x=true_1"]
OTHERS = ["x=true", "x=null", "x=1e3", "x=01", "x=1_0", "x=.5", "x=1.", "x=[1]", "x='a'", "x=a-b"]
OTHERS += ["x=${y}", "x= 1", "x=", "~x=1", "+x=1", "++x=[1]", "X=1", "x=a.yaml"]
SEVERAL = {"x=1,2": [1, 2], "x=range(0,1,0.5)": [0.0, 0.5], "x='a b',c": ["a b", "c"]}


@pytest.mark.parametrize("text", [*PLAIN, *OTHERS])
def test_they_are_what_hydra_reads(text):
    theirs, ours = OverridesParser.create().parse_override(text), parse(text, TYPED)
    assert (ours.text, ours.key, ours.sweep) == (text, theirs.key_or_group, None)
    assert repr(ours.value) == repr(theirs.value())
    assert ours.singles() == [ours]
    assert (overrides._PLAIN.fullmatch(text) is not None) == (text in PLAIN)


def test_several_values_are_overrides_of_one_value_each_and_texts_have_their_parts():
    for text, expected in SEVERAL.items():
        assert parse(text, TYPED).value is None
        assert [one.value for one in parse(text, TYPED).singles()] == expected
    assert [one.text for one in parse("+x=1,2", TYPED).singles()] == ["+x=1", "+x=2"]
    inner, key = (
        parse(text, TYPED) for text in ("++measurement/noise=constant", "measurement.rays= [1,2]")
    )
    assert (inner.sign, inner.key) == ("++", "measurement/noise")
    assert (key.sign, key.value_text) == ("", "[1,2]")
    assert {outermost_group(one.key) for one in (inner, key)} == {"measurement"}


def test_one_file_takes_an_override_apart():
    package = Path(stixel_cli.__file__).parent
    found = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if 'partition("=")' in path.read_text(encoding="utf-8")
    ]
    assert found == ["config/texts.py"]


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
    ["path=crossing", "road_user=pedestrian", "tracker.slip=0.2", "measurement='fabricated'"],
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
    plain = choice.compose_options(options, conf_state())[0]
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


IMPOSSIBLE = {
    "measurement=fabricated measurement.rays=641": "measurement.rays: must be ≤ rig.width",
    "path.start=[1,-3]": "path.start: the path starts behind the camera",
    "path.start=[0.5,1]": "path.start: must be at least 1.9 m from the camera, got 1.1 m",
    "path=waypoints path.points=[[0,1],[0,9]]": "path.points: must be at least 1.9 m from the "
    "camera, got 1 m",
    "path=waypoints path.points=[[0,9]]": "path.points: must have at least two points, got 1",
    "path=waypoints path.points=[]": "path.points: must have at least two points, got 0",
    "path=waypoints path.points=[[0,10],[0,10],[5,9]]": "path.points: points 0 and 1 are the same",
    "path=waypoints path.points=[[0,10],[0,20],[0,12]]": "path.points: the path turns back on "
    "itself at point 1",
    "path=approach path.heading=90": "path=approach must lead from path.start towards",
    "path=depart path.heading=-90": "path=depart must lead from path.start away",
    "path=crossing path.heading=180": "path=crossing must lead from left to right",
    **{
        f"path={path} path.duration=3600 path.sample_time=0.001": "more than 100000 scans"
        for path in group_options()["path"]
        if path != "recorded"
    },
    "path.duration=0.05": "path.sample_time: must be <= path.duration (0.05 s), got 0.1 s",
    "pictures.frames=[3,1]": "pictures.frames: must be increasing",
    "pictures.frames=[3,3]": "pictures.frames: must be increasing",
    "rig.focal_length=700": "rig.focal_length: set either",
    "rig.horizontal_fov=null": "rig.focal_length: set either",
    "rig.principal_v=480": "rig.principal_v: must be 0 to 479 (the image), got 480",
    "stereo.nearest=0.1": "stereo.nearest: at 0.1 m the disparity is 1663 px; it must be < "
    "rig.width (640)",
    "stereo=bm rig.height=64 rig.width=128 stereo.block_size=65": "stereo.block_size: must be "
    "smaller than the image, 128 × 64, got 65",
    "stereo.block_size=4": "stereo.block_size: must be odd",
    "road_user.mesh=/no/such/file.obj": "road_user.mesh: ",
    "road_user.mesh=/": "road_user.mesh: ",
    "road_user.mesh=": "road_user.mesh: ",
    "road_user.mesh=/ road_user.shape_seed=1": "road_user.shape_seed: must be null with road_user.",
    "road_user.mesh_scale=0.001": "give road_user.mesh=FILE",
    "road_user.mesh_forward=-y": "give road_user.mesh=FILE",
    **{
        f"occupancy={kind} occupancy.nearest=60": "occupancy.nearest: must be < occupancy.farthest"
        for kind in group_options()["occupancy"]
    },
    "measurement.height_min=5 measurement.height_max=2.5": "measurement.height_max: must be > "
    "measurement.height_min",
    "prior.corner_radius=2": "prior.corner_radius: must be ≤",
    "experiment=thesis tracker=point": "prior.shape: tracker=point needs the shape of the class, "
    "got none",
}


@pytest.mark.parametrize("overrides", IMPOSSIBLE)
def test_the_impossible_is_refused(overrides):
    with pytest.raises(ConfigurationError) as error:
        compose(overrides.split())
    assert IMPOSSIBLE[overrides] in str(error.value)
    assert "\n" not in str(error.value)
