import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml

from stixel_cli.border.origins import TYPED
from stixel_cli.config import choice
from stixel_cli.config.compose import Composer, compose, from_resolved
from stixel_cli.config.folders import group_options, option_values, outermost_group, shipped_folder
from stixel_cli.config.overrides import read_overrides
from stixel_cli.config.texts import override_text
from stixel_cli.engine.entries import collect
from stixel_cli.engine.store import Store
from stixel_cli.errors import ConfigurationError, UserError


@pytest.fixture(scope="module")
def default():
    return compose()


def test_default_is_what_the_readme_says_and_nobody_else_s(default):
    expected = dict(road_user="car", path="turn", ego="parked", rig="default", renderer="raycast")
    expected |= dict(stereo="sgm", occupancy="polar", measurement="stixels", tracker="gp_ekf")
    assert expected.items() <= default.choices.items()
    assert default.choices.keys() == {group for group in group_options() if "/" not in group}
    assert default.configuration.seed == 0
    assert default.overrides == ()
    compose().resolved["rig"]["width"] = 1
    assert compose() == default and compose() is not default


@pytest.mark.parametrize("tracker", ["contour", "gp_ekf"])
def test_a_tracker_knows_that_a_source_is_the_users_own(tracker):
    own = "measurement=stixel_cli.studies.wrong_poses:wrong_poses"
    assert compose([own, f"tracker={tracker}"]).configuration.tracker.seen_by == "own"


@pytest.mark.parametrize("user", group_options()["road_user"])
def test_pace_and_prior_follow_the_road_user(user):
    composition = compose([f"road_user={user}"])
    assert composition.choices["pace"] == composition.choices["prior"] == user
    assert composition.configuration.path.speed == option_values("pace", user)["turn_speed"]
    assert "pace" not in composition.resolved


def test_a_key_changes_that_key_alone_and_has_the_type_of_the_schema(default):
    changed = compose(["tracker.length_scale=0.6"])
    tracker = replace(default.configuration.tracker, length_scale=0.6)
    assert changed.configuration == replace(default.configuration, tracker=tracker)
    assert changed.overrides == ("tracker.length_scale=0.6",)
    composed = compose(["rig.baseline=1", "road_user.mesh=null", "pictures.frames=[0,5]"])
    baseline = composed.configuration.rig.baseline
    assert baseline == 1.0
    assert type(baseline) is float
    assert composed.configuration.pictures.frames == (0, 5)


def test_stored_configuration_comes_back(default):
    fabricated = compose(["path=circle", "rig=kitti", "measurement=fabricated"])
    constant = compose(["measurement=fabricated", "measurement/noise=constant"])
    assert fabricated.configuration.measurement.noise.kind == "stereo"
    assert constant.configuration.measurement.noise.kind == "constant"
    assert constant.choices["measurement/noise"] == "constant"
    for composition in (default, fabricated, constant):
        stored = yaml.safe_load(yaml.safe_dump(composition.resolved))
        assert from_resolved(stored) == composition.configuration
    with pytest.raises(ConfigurationError, match="not a configuration"):
        from_resolved([1, 2])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda plain: plain["rig"].pop("width"), "rig.width: is missing"),
        (
            lambda plain: plain["rig"].update(widht=3),
            "rig.widht: is no key of this version: make the run anew without it",
        ),
        (lambda plain: plain.pop("tracker"), "tracker: is missing"),
        (lambda plain: plain.update(sedd=3), "sedd: is no key of this version"),
        (lambda plain: plain["path"].update(kind="loop"), "path: its kind is unknown"),
        (lambda plain: plain.update(rig=3), "rig: 3 is a whole number"),
        (lambda plain: plain.update(rig=None), "rig: has no value"),
        (lambda plain: plain.update(source=16), "a whole number: must be a group of keys"),
        (lambda plain: plain["rig"].update(baseline=-1), "must be ≥ 0.001 and ≤ 5"),
        (lambda plain: plain["road_user"].update(mesh="\udcff"), "not UTF-8"),
        (lambda plain: plain["road_user"].update(mesh=object), "is not JSON serializable"),
        (lambda plain: noise(plain).update(kind="white"), "measurement.noise: its kind is unknown"),
        (lambda plain: noise(plain).pop("kind"), "measurement.noise: its kind is unknown"),
        (lambda plain: noise(plain).pop("range_std"), "measurement.noise.range_std: is miss"),
        (lambda plain: noise(plain).update(range_std=-1), "must be ≥ 0 and ≤ 10"),
        (
            lambda plain: noise(plain).update(range_devation=1),
            "range_devation: is no key of this version: make the run anew without it",
        ),
        (
            lambda plain: noise(plain).update(disparity_std=0.1),
            "with measurement/noise=constant; it belongs to measurement/noise=stereo",
        ),
    ],
)
def test_stored_configuration_that_is_wrong(change, message):
    composed = compose(["measurement=fabricated", "measurement/noise=constant"])
    plain = yaml.safe_load(yaml.safe_dump(composed.resolved))
    change(plain)
    with pytest.raises(ConfigurationError) as error:
        from_resolved(plain)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def noise(plain):
    return plain["measurement"]["noise"]


def test_nothing_stays_behind_in_hydra():
    from hydra.core.global_hydra import GlobalHydra

    with pytest.raises(ConfigurationError):
        compose(["measurement.rays=3"])
    compose()
    assert not GlobalHydra.instance().is_initialized()


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["road_user=cyclist", "path=s_curve", "path.swing=3", "seed=9"],
        ["path=waypoints", "path.points=[[0,12],[3,15.5]]", "path.speed=${pace.turn_speed}"],
        ["++rig.width=800", "rig=kitti", "pictures.frames=null", "road_user.contrast=0.25"],
        ["measurement=fabricated", "measurement/noise=constant", "measurement.rays=9"],
        ["measurement.noise.disparity_std=0.2", "measurement=fabricated"],
        ["measurement=fabricated", "measurement/noise=constant", "road_user=cyclist", "stereo=bm"],
        ["measurement=lidar", "pace=car", "path=crossing", "prior=unknown", "road_user=pedestrian"],
    ],
)
def test_it_is_what_hydra_composes(overrides):
    import hydra
    from omegaconf import OmegaConf

    with hydra.initialize_config_dir(str(shipped_folder("conf")), version_base="1.3"):
        composed = hydra.compose("config", overrides=overrides)
    expected = OmegaConf.to_container(composed, resolve=True)
    expected.pop("pace")  # values for the options of path
    assert compose(overrides).resolved == expected
    assert list(compose(overrides).resolved) == list(expected)


def test_an_edited_file_is_seen(own_conf):
    before = compose(["rig=kitti"]).configuration.rig
    kitti = own_conf / "rig" / "kitti.yaml"
    text = kitti.read_text(encoding="utf-8")
    assert "width: 1242" in text
    kitti.write_text(text.replace("width: 1242", "width: 1240 "), encoding="utf-8")
    assert compose(["rig=kitti"]).configuration.rig == replace(before, width=1240)
    shutil.copy(kitti, kitti.with_name("mine.yaml"))
    assert compose(["rig=mine"]).choices["rig"] == "mine"


def test_an_option_that_follows_and_is_not_there_says_where_it_belongs(own_conf):
    of_groups = {name: "|".join(group_options()[name]) for name in ("pace", "prior")}
    users = own_conf / "road_user"
    shutil.copy(users / "cyclist.yaml", users / "cargo.yaml")
    with pytest.raises(ConfigurationError) as error:
        compose(["road_user=cargo"])
    group = str(error.value).partition(":")[0]
    assert group in {"pace", "prior"}
    assert str(error.value) == (
        f"{group}: unknown option 'cargo', which follows from what is chosen; "
        f"add conf/{group}/cargo.yaml, or choose {group}={of_groups[group]}"
    )
    chosen = compose(["road_user=cargo", "pace=cyclist", "prior=cyclist"])
    assert chosen.choices["road_user"] == "cargo"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"a: [\n", "turn.yaml: line 2: did not find expected"),
        (b"[" * 100_000, "turn.yaml: nested more than 50 levels deep"),
        (b"a: \xff", "turn.yaml: not a text in UTF-8"),
        (b"a: 1\na: 2\n", "turn.yaml"),
    ],
)
def test_a_damaged_file_is_named(own_conf, content, said):
    (own_conf / "path/turn.yaml").write_bytes(content)
    with pytest.raises(UserError) as error:
        compose(["path=turn"])
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_names_of_files_are_absolute_and_may_be_words_of_other_keys(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine.obj").touch()
    for given, directory in (("'~/mine.obj'", "/"), ("mine.obj", str(tmp_path))):
        words = [f"road_user.mesh={given}", f"cache.folder={given}"]
        typed = Composer(directory).compose(read_overrides(words, TYPED))
        for composed in (compose(words, directory), typed):
            assert composed.resolved["road_user"]["mesh"] == str(tmp_path / "mine.obj")
            assert composed.configuration.cache.folder == str(tmp_path / "mine.obj")
    composer = Composer(str(tmp_path))
    found = composer.compose(read_overrides(["measurement=file", "measurement.path=none"], TYPED))
    assert found.value("measurement.path") == str(tmp_path / "none")


def test_compositions_are_stored_damaged_ones_are_ignored_old_ones_removed_and_none_needs_hydra(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path))
    choice.compose_options.cache_clear()
    composed = compose()
    (stored,) = (tmp_path / choice.FOLDER).iterdir()
    for content in (stored.read_bytes(), stored.read_bytes().replace(b"640", b"641"), b"\xff"):
        stored.write_bytes(content)
        choice.compose_options.cache_clear()
        assert compose() == composed
    compose(["rig=kitti"])
    choice.compose_options.cache_clear()
    expected = compose(["rig=kitti"])
    monkeypatch.setattr(choice, "_by_hydra", None)
    choice.compose_options.cache_clear()
    assert compose(["rig=kitti"]) == expected
    assert compose(["path=circle", "tracker=box"]).choices["path"] == "circle"
    os.utime(stored, (0.0, 0.0))
    assert collect(Store(tmp_path)).left == 1 and not stored.exists()


@pytest.mark.parametrize("experiment", group_options()["experiment"])
def test_options_of_groups_that_stand_alone_are_as_hydra_composes_them(experiment, monkeypatch):
    own = {g: o for g, o in group_options().items() if outermost_group(g) not in choice.TOGETHER}
    for i in range(max(map(len, own.values())) if experiment == "none" else 2):
        options = {group: options[i % len(options)] for group, options in own.items()}
        options |= {"experiment": experiment, "road_user": "cyclist"}
        fast = choice.compose_options((*options.items(),), "fast")
        with monkeypatch.context() as patch:
            patch.setattr(choice, "TOGETHER", (*own, *choice.TOGETHER))
            slow = choice.compose_options((*options.items(),), "slow")
        assert fast == slow and repr(fast) == repr(slow)


def test_composing_creates_no_cache_and_needs_none(tmp_path, monkeypatch, default):
    (tmp_path / "file").touch()
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "file"))
    choice.compose_options.cache_clear()
    assert compose() == default
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "missing"))
    choice.compose_options.cache_clear()
    assert compose() == default
    assert not (tmp_path / "missing").exists()


@pytest.mark.parametrize(
    ("overrides", "half"),
    [
        (["rig=long_range"], 22.5),
        (["measurement=lidar"], 30.0),
        (["measurement=lidar", "measurement.scanner.horizontal_fov=100"], 50.0),
        (["measurement=file", "measurement.path=scans.csv"], None),
        (["measurement=file", "measurement.path=a.csv", "measurement.horizontal_fov=270"], 135.0),
    ],
)
def test_the_field_of_view_is_that_of_the_sensor(overrides, half):
    view = compose(overrides).configuration.field_of_view
    expected = None if half is None else pytest.approx(np.radians([-half, half]), abs=1e-3)
    assert view == expected


@pytest.mark.parametrize("plain", ["/tmp/clips/a-b", "0000", "0005", "contour"])
def test_texts_that_need_no_quotes_have_none(plain):
    from hydra.core.override_parser.overrides_parser import OverridesParser

    text = override_text("source.sequence", plain)
    assert text == f"source.sequence={plain}"
    assert OverridesParser.create().parse_override(text).value() == plain
    for special in ("12", "00.5", "null", "a b", "0"):
        assert "'" in override_text("source.sequence", special)
