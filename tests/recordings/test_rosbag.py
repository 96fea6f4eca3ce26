"""Recordings in bags of ROS 1 and ROS 2."""

import json
import re
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest
from damages import cut, missing, text
from made_bag import IMAGE, INFO, ODOMETRY, START, STATIC, STEP, header, messages, write_bag
from made_clip import plain_folder, small_rig

from stixel_cli.cli.app import main
from stixel_cli.recordings.find import find_recording, guess_layout
from stixel_cli.recordings.parameters import Rosbag
from stixel_cli.recordings.stereo_images import read_left, read_pairs
from stixel_cli.recordings.truth import recorded_motion

pytest.importorskip("rosbags", reason="needs pip install 'stixel[rosbag]'")

SMALL = ("stereo.nearest=1.6", "occupancy.nearest=3", "rig.camera_height=1.65")
SCENE = ("road_user=car", "start.range=[5,15]", "executor=threads", "pictures.frames=[]")


@pytest.fixture(scope="module")
def bag(clip, tmp_path_factory):
    """Folder of a ROS 2 bag in MCAP."""
    return write_bag(tmp_path_factory.mktemp("bag") / "drive", messages(clip, "mono8"))


def source(folder, compressed="", **changes):
    values = {"target": None, "frames": None, "sample_time": 0.1, "odometry_topic": ODOMETRY}
    topics = {f"{side}_topic": IMAGE.format(side) + compressed for side in ("left", "right")}
    return Rosbag(kind="rosbag", folder=str(folder), **topics | values | changes)


def plain(clip, folder):
    return find_recording(replace(plain_folder(clip, folder), target=None, frames="1:5"))


WAYS = [("drive", "rgba8", "sqlite3"), ("drive", "png", "sqlite3"), ("drive.bag", "bgr8", "")]
WAYS += [("drive", encoding, "mcap") for encoding in ("mono8", "mono16", "16UC3", "32FC1")]


@pytest.mark.parametrize(("name", "encoding", "plugin"), [*WAYS, ("drive.mcap", "mono8", "mcap")])
def test_a_bag_has_the_images_and_poses_of_the_folder_it_was_made_from(
    name, encoding, plugin, clip, tmp_path
):
    single = name.endswith(".mcap")
    path = tmp_path / (name if name.endswith(".bag") else "drive")
    write_bag(path, messages(clip, encoding), plugin or "mcap")
    path = path / name if single else path
    assert guess_layout(path) == "rosbag"
    there = plain(clip, tmp_path / "plain")
    found = find_recording(source(path, "/compressed" if encoding == "png" else ""))
    # Without the first pair, at which there is no odometry.
    assert found.frames == range(4)
    assert (found.width, found.height) == (there.width, there.height) == (160, 96)
    assert found.calibration == replace(there.calibration, camera_height=None)
    ours = read_pairs(found.images, range(1, 4), None, found.messages)
    theirs = read_pairs(there.images, range(1, 4))
    assert (ours.left.encoded, ours.right.encoded) == (theirs.left.encoded, theirs.right.encoded)
    left = read_left(found.left, 2, None, found.messages)
    assert left.encoded == read_left(there.left, 2).encoded
    both = [(one.pose_files, one.tables) for one in (found, there)]
    motions = [recorded_motion(*files, 4, 0.1, small_rig()) for files in both]
    poses, expected = (motion.poses_world for motion in motions)
    np.testing.assert_allclose(poses, expected, atol=1e-6)
    assert np.ptp(poses[:, 1]) > 0.5


def run(capsys, *words):
    code = main(["run", "--json", *SMALL, *SCENE, *words])
    said = capsys.readouterr()
    assert code == 0, said.err
    return json.loads(said.out)


def test_a_bag_runs_as_the_folder_it_was_made_from(bag, clip, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    plain_folder(clip, tmp_path / "plain")
    words = ("source.folder=plain", "source.sample_time=0.1", "source.frames=1:5")
    there = run(capsys, *words, "--name", "there")
    words = (f"source.folder={bag}", f"source.odometry_topic={ODOMETRY}")
    found = run(capsys, *words, "--name", "found")
    for name, value in there["metrics"].items():
        assert found["metrics"][name] == pytest.approx(value, rel=1e-6), name
    files = [f"results/{name}/track.csv" for name in ("found", "there")]
    ours, theirs = (np.genfromtxt(file, delimiter=",", names=True) for file in files)
    np.testing.assert_allclose(ours.tolist(), theirs.tolist(), rtol=1e-5, atol=1e-6)
    # In the cache as any recording: moved, it is the same.
    shutil.move(bag, "moved")
    again = run(capsys, "source.folder=moved", words[1], "--name", "again")
    assert {stage["status"] for stage in again["stages"]} == {"cached"}
    shutil.move("moved", bag)
    # Without odometry.
    assert main(["run", *SMALL, *SCENE, f"source.folder={bag}"]) == 2
    assert "poses of the ego car (source.odometry_topic)" in capsys.readouterr().err
    assert run(capsys, f"source.folder={bag}", "ego=parked")["metrics"]["scans"] == 5


def said_of(capsys, folder, *words):
    """The error of a run that must not begin."""
    words = [f"source.folder={folder}", f"source.odometry_topic={ODOMETRY}", *words]
    assert main(["run", "source=rosbag", *SMALL, *SCENE, *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith("stixel: ") and str(folder.parent) in said
    return said


def without(topic, where=lambda one: True):
    return lambda content: [one for one in content if one[0] != topic or not where(one)]


def edited(topic, **changes):
    def edit(content):
        given = ((head, changes if head[0] == topic else {}, fields) for *head, fields in content)
        return [(*head, fields | own) for head, own, fields in given]

    return edit


LEFT, INFO_LEFT = IMAGE.format("left"), INFO.format("left")
OF_LEFT = np.array([150.0, 0, 78, 0, 0, 150, 40, 0, 0, 0, 1, 0])
CONTENT = {
    "no such topic": (without(LEFT), f"{LEFT}, .*no such topic.*; it has /stereo/right/image_rect"),
    "no camera_info": (without(INFO_LEFT), f"{INFO_LEFT}: no such topic of sensor_msgs/msg/"),
    "no odometry": (without(ODOMETRY), "/odom: no such topic of .*/Odometry; it has none"),
    "no transforms": (without(STATIC), "/tf_static: no such topic of tf2_msgs/msg/TFMessage"),
    "another base": (edited(ODOMETRY, child_frame_id="wheel"), "from wheel.* to left_optical"),
    "not calibrated": (edited(INFO_LEFT, p=np.zeros(12)), "not a camera's projection"),
    "no baseline": (edited(INFO.format("right"), p=OF_LEFT), "no baseline"),
    "other size": (edited(INFO_LEFT, width=640), r"160.* px, but camera_info has \(640, 96\)"),
    "other encoding": (edited(LEFT, encoding="bayer_rggb8"), "encoding bayer_rggb8: must be mono"),
    "short image": (edited(LEFT, data=np.zeros(99, np.uint8)), f"{LEFT}: a damaged image: 99 byt"),
    "no pair": (
        without(LEFT, lambda one: one[1] >= START + STEP),
        "no pair of images at one time",
    ),
    "gap": (
        without(LEFT, lambda one: one[3]["header"] == header(START + 2 * STEP, "left_optical")),
        "source.frames: frames 0 and 1 of .* 0.200 s apart, but source.sample_time is 0.1",
    ),
}


@pytest.mark.parametrize(("change", "said"), CONTENT.values(), ids=CONTENT)
def test_wrong_content_is_refused_in_one_line(change, said, clip, tmp_path, capsys):
    path = write_bag(tmp_path / "drive", change(messages(clip, "mono8")))
    assert re.search(said, said_of(capsys, path))


FILES = {
    "no file": ("x", "drive.mcap", missing, "drive.mcap is missing"),
    "not a bag": ("x", "drive.mcap", text("text"), "not a bag of ROS: "),
    "cut": ("mcap", "drive/drive.mcap", cut(0.5), "not a bag of ROS: ReaderError: File end magic"),
    "cut database": ("sqlite3", "drive/drive.db3", cut(0.5), "not a bag of ROS: "),
    "cut ROS 1": ("", "drive.bag", cut(0.5), "not a bag of ROS: "),
    "missing part": ("mcap", "drive/drive.mcap", missing, "drive.mcap is missing"),
    "no metadata": ("mcap", "drive/metadata.yaml", text("a: 1"), "not the metadata of a ROS 2 bag"),
}


@pytest.mark.parametrize(("plugin", "name", "damage", "said"), FILES.values(), ids=FILES)
def test_a_wrong_file_is_refused_in_one_line(plugin, name, damage, said, clip, tmp_path, capsys):
    bag = tmp_path / name.partition("/")[0]
    if plugin == "x":
        bag.touch()
    else:
        write_bag(bag, messages(clip, "mono8"), plugin or "mcap")
    damage(tmp_path / name)
    assert re.search(said, said_of(capsys, bag))


def test_without_rosbags_a_line_says_how_to_install_it(bag, monkeypatch, told):
    monkeypatch.setitem(sys.modules, "rosbags", None)
    assert "pip install 'stixel[rosbag]'" in told("run", f"source.folder={bag}", code=2)
