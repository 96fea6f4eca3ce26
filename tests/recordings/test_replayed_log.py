"""`path=recorded` with a log of Argoverse 2: labels and ego poses, with or without calibration."""

import numpy as np
import pytest
from made_argoverse import STEP, TARGET, make_motion
from real_data import real_data
from refusals import refused

from stixel_cli import compose
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.recordings.replay import find_motion, replayed_scenario
from stixel_cli.recordings.tables import read_labels, read_poses
from stixel_cli.recordings.truth import recorded_motion

pytest.importorskip("pyarrow", reason="needs pip install 'stixel[argoverse]'")


def of(folder, *more):
    return ["path=recorded", f"path.folder={folder}", f"path.target={TARGET}", *more]


@pytest.mark.parametrize("mounted", [True, False])
def test_target_and_ego_car_move_as_they_did(mounted, tmp_path):
    """The target's straight line is kept by the smoothing; the turning ego car is not smoothed."""
    cameras, targets = make_motion(tmp_path, mounted)
    composition = compose(of(tmp_path, "measurement=fabricated"))
    assert composition.choices["road_user"] == composition.choices["prior"] == "cyclist"
    assert composition.configuration.path.frames == "0:12"
    stages = {stage.name: stage for stage in pipeline_stages(composition)}
    ego, truth = stages["ego_motion"], stages["scenario"]
    assert len(ego.files) == 1 + mounted
    motion = recorded_motion(ego.files, **ego.settings)
    found = replayed_scenario(motion, truth.files, **truth.settings)
    np.testing.assert_allclose(found.ego_poses_world, cameras, atol=1e-6)
    np.testing.assert_allclose(found.target_poses_world, targets, atol=1e-6)
    speeds = np.hypot(*found.target_rates_world[:, :2].T)
    np.testing.assert_allclose(speeds, np.hypot(3.0, 1.0), atol=1e-5)


WRONG = {
    "path.sequence=3": "path.sequence: {} is one log of Argoverse 2: leave it out",
    "path.target=7": "path.target: {}/annotations.feather has no track 7; it has 022c398c",
    "path.sample_time=0.05": "frames 0 and 1 of {} are 0.100 s apart, but path.sample_",
    "path.frames=3:20": "path.frames: track 022c398c-0000-4000-8000-000000000001 of clip log",
}


@pytest.mark.parametrize(("override", "said"), WRONG.items())
def test_wrong_input_is_refused_in_one_line(override, said, tmp_path):
    make_motion(tmp_path / "log", mounted=False)
    words = of(tmp_path / "log")
    if "target" in override:
        words.pop()
    with refused(said.format(tmp_path / "log")):
        compose([*words, override])


def test_real_logs_have_labels_and_a_smooth_ego_motion():
    """`-s` prints how many tracks there are, and how many of them move."""
    ways = {}
    for file in sorted(real_data("argoverse2").glob("*/annotations.feather")):
        found = find_motion(file.parent, None)
        steps = np.diff(found.tables.times)
        assert np.abs(steps / STEP - 1.0).max() < 0.05
        poses = read_poses(found.pose_files, found.tables)
        assert len(poses) == found.count
        velocities = np.diff(poses[:, :, 3], axis=0) * 10.0
        assert np.linalg.norm(np.diff(velocities, axis=0) * 10.0, axis=1).max() < 10.0
        for labels in read_labels(found.label_files, found.tables).values():
            places = np.einsum("nij,nj->ni", poses[labels.frames, :, :3], labels.places)
            places += poses[labels.frames, :, 3]
            if labels.kind == "Pedestrian":
                # At most a run, in steps of 0.1 s.
                assert np.linalg.norm(np.diff(places, axis=0), axis=1).max(initial=0.0) < 0.8
            away = np.linalg.norm(places[-1] - places[0])
            ways.setdefault(labels.kind, []).append(away)
    for kind in ("Car", "Cyclist", "Pedestrian"):
        moving = sum(way > 1.0 for way in ways[kind])
        print(f"{kind}: {len(ways[kind])} tracks, {moving} end more than 1 m from their start")
    assert sum(way > 1.0 for way in ways["Pedestrian"]) > 10
