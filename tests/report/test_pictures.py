"""The picture stages: which frames they picture, and what they give, whatever the run."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.patches import Polygon, Rectangle
from playback_runs import make_run, with_objects
from report_nouns import (
    make_camera_nouns,
    make_ego_motion,
    make_rig,
    make_scans,
    make_scenario,
    make_scores,
    make_track,
)

from stixel_cli.config.compose import compose
from stixel_cli.pictures import ground, style
from stixel_cli.pictures.birds_eye import moving_pictures, track_pictures
from stixel_cli.pictures.camera import camera_pictures
from stixel_cli.pictures.over_time import error_pictures
from stixel_cli.pictures.path_figure import path_figure, path_pictures, spaced_frames
from stixel_cli.recordings.types import LabelTruth
from stixel_cli.rendering.images import decode_image
from stixel_cli.stixels.types import Objects
from stixel_cli.tracking.track import ObjectTrack

VIEW = make_rig().field_of_view

CAMERA = ("left", "disparity", "occupancy", "free_space", "height", "stixels", "camera")


@pytest.fixture
def run():
    rng = np.random.default_rng(3)
    scenario = make_scenario()
    scans = make_scans(scenario, rng)
    track = make_track(scenario, scans, rng)
    return {"scans": scans, "track": track, "scenario": scenario, "field_of_view": VIEW}


TRACKER = compose().configuration.tracker


def make_camera_inputs(rig, kind="polar"):
    rng = np.random.default_rng(4)
    rendered, pairs, disparities, free_space, stixels = make_camera_nouns(rig, rng)
    configuration = compose([f"occupancy={kind}"]).configuration
    return {
        "rendered": rendered,
        "pairs": pairs,
        "disparities": disparities,
        "free_space": free_space,
        "stixels": stixels,
        "ego_motion": make_ego_motion(),
        "rig": rig,
        "road": configuration.road,
        "occupancy": configuration.occupancy,
        "frame": 5,
    }


def check_pngs(files, least_height=250):
    for name, data in files.items():
        if name.endswith(".png"):
            height, width = decode_image(data).shape[:2]
            assert least_height <= height <= 2000, name
            assert 400 <= width <= 2000, name
            assert b"Software" not in data, name
            assert b"tEXt" not in data, name


def test_the_legend_names_no_camera(run):
    # The same picture is drawn of a lidar's scans.
    (legend,) = path_figure(run["track"], run["scenario"], VIEW).legends
    names = [text.get_text() for text in legend.get_texts()]
    assert "ego car's sensor" in names and not any("camera" in name for name in names)


@pytest.mark.parametrize("kind", ["polar", "column_disparity", "cartesian"])
def test_camera_pictures_have_all_panels(kind):
    pictures = camera_pictures(**make_camera_inputs(make_rig(), kind))
    assert set(pictures.files) == {f"k0005/{name}.png" for name in CAMERA}
    check_pngs({"camera.png": pictures.files["k0005/camera.png"]})


def test_camera_pictures_keep_the_pixels_and_paint_stixels_by_depth_and_objects():
    inputs = make_camera_inputs(make_rig(640, 200))
    name = "k0005/stixels.png"
    plain = decode_image(camera_pictures(**inputs).files[name])
    stixels, grey = inputs["stixels"], inputs["pairs"].left[5 - inputs["pairs"].first]
    rows = stixels.rows(5 - stixels.first)
    row = rows.start + int(np.argmin(stixels.depth[rows]))  # nothing covers the nearest one
    v, u = stixels.base[row], stixels.left[row]
    colour = 255.0 * style.depth_colours(stixels.depth[row : row + 1])[0]
    assert np.abs(plain[v, u] - (0.65 * colour + 0.35 * grey[v, u])).max() <= 1.0
    box = np.array([[10, 60, 20, 90]])
    counts, of_stixels = np.ones(1, np.int64), np.full(len(stixels.depth), -1, np.int32)
    one = Objects(5, np.array([0, 1]), box, np.zeros((1, 4, 2)), counts, of_stixels)
    boxed = decode_image(camera_pictures(**inputs, objects=one).files[name])
    assert (boxed[90, 10:60] == boxed[90, 10]).all() and (boxed[90, 10] != plain[90, 10]).any()
    # A number that would cover another is left out.
    two = replace(one, boxes=box[[0, 0]], offsets=np.array([0, 2]))
    assert np.array_equal(decode_image(camera_pictures(**inputs, objects=two).files[name]), boxed)
    # Below the image, the colours of depth from the nearest to the farthest.
    ends = style.depth_colours(np.array(style.DEPTH_TICKS)[[0, -1]])
    assert np.array_equal(plain[200, [0, -1]], np.rint(255.0 * ends))
    picture = decode_image(camera_pictures(**inputs).files["k0005/left.png"])
    image = inputs["rendered"].left[1]
    assert np.array_equal(picture, image)


def test_camera_pictures_accept_empty_results():
    inputs = make_camera_inputs(make_rig(), "polar")
    free, stixels = inputs["free_space"], inputs["stixels"]
    nothing = {
        name: value[:0]
        for name, value in vars(stixels).items()
        if isinstance(value, np.ndarray) and name != "offsets"
    }
    inputs["stixels"] = replace(stixels, offsets=np.zeros(3, np.int64), **nothing)
    inputs["free_space"] = replace(
        free,
        disparity=np.full_like(free.disparity, np.nan),
        base_row=np.full_like(free.base_row, -1),
    )
    files = camera_pictures(**inputs).files
    check_pngs({"camera.png": files["k0005/camera.png"]})
    grey = np.repeat(inputs["pairs"].left[5 - inputs["pairs"].first][..., None], 3, axis=2)
    assert np.array_equal(decode_image(files["k0005/stixels.png"])[: len(grey)], grey)


def test_used_points_have_the_ellipses_of_the_tracker_s_noise(run, monkeypatch):
    drawn = {}
    monkeypatch.setattr(
        ground, "draw_points", lambda axes, points, noise, colour: drawn.update({colour: noise})
    )
    track_pictures(**run, tracker=TRACKER, frame=4)
    assert np.allclose(drawn[style.USED], TRACKER.measurement_std**2 * np.eye(2))
    assert not np.allclose(drawn[style.UNUSED][:, 0, 0], TRACKER.measurement_std**2)


def test_birds_eye_is_drawn_also_of_an_empty_scan_and_a_non_finite_track(run):
    pictures = track_pictures(**run, tracker=TRACKER, frame=4)
    assert set(pictures.files) == {"k0004/birds_eye.png"}
    check_pngs(pictures.files)
    assert len(run["scans"].points_world[run["scans"].rows(5)]) == 0
    check_pngs(track_pictures(**run, tracker=TRACKER, frame=5).files)
    not_finite = replace(
        run["track"],
        means=np.full_like(run["track"].means, np.nan),
        contours_world=np.full_like(run["track"].contours_world, np.nan),
    )
    check_pngs(track_pictures(**run | {"track": not_finite}, tracker=TRACKER, frame=4).files)


def test_several_tracks_and_labels_are_drawn_from_above(run):
    scans, track, truth = run["scans"], run["track"], LabelTruth("7", "car", run["scenario"])
    objects = with_objects(make_run()).objects[0]
    drawn = {}
    for name, tracks, truths in (
        ("both", (ObjectTrack(0, 5, track),), (truth,)),
        ("label", (), (truth,)),
        ("neither", (), ()),
    ):
        pictures = moving_pictures(scans, tracks, truths, objects, VIEW, 4).files
        assert set(pictures) == {"k0004/birds_eye.png"}
        check_pngs(pictures)
        drawn[name] = pictures["k0004/birds_eye.png"]
    assert len(set(drawn.values())) == 3
    # A track that ends before the scan is not drawn in it.
    later = (ObjectTrack(5, 9, track),)
    assert moving_pictures(scans, later, (), objects, VIEW, 4).files == {
        "k0004/birds_eye.png": drawn["neither"]
    }


def run_pictures(scans, track, scenario, field_of_view, scores):
    path = path_pictures(track, scenario, field_of_view).files
    return path | error_pictures(scans, track, scenario, scores).files


def test_run_pictures_are_png_and_svg_also_of_one_scan_and_a_stopped_target(run):
    scores = make_scores(run["scenario"], run["track"])
    files = run_pictures(**run, scores=scores)
    assert set(files) == {"path.png", "path.svg", "errors.png", "errors.svg"}
    check_pngs(files)
    for name in ("path.svg", "errors.svg"):
        assert files[name].startswith(b"<?xml")
        assert b"<dc:date>" not in files[name]
        assert b"matplotlib.org" not in files[name]
    rng = np.random.default_rng(5)
    for count in (1, 4):
        scenario = make_scenario(count)
        poses = np.repeat(scenario.target_poses_world[:1], count, axis=0)
        ego = np.repeat(scenario.ego_poses_world[:1], count, axis=0)
        scenario = replace(scenario, target_poses_world=poses, ego_poses_world=ego)
        scans = make_scans(scenario, rng)
        track = make_track(scenario, scans, rng)
        scores = make_scores(scenario, track)
        check_pngs(run_pictures(scans, track, scenario, VIEW, scores))


def test_pictures_have_repeatable_bytes(run, monkeypatch, tmp_path):
    scores = make_scores(run["scenario"], run["track"])
    camera = make_camera_inputs(make_rig())

    def draw():
        return (
            run_pictures(**run, scores=scores)
            | track_pictures(**run, tracker=TRACKER, frame=4).files
            | camera_pictures(**camera).files
        )

    import matplotlib

    first = draw()
    with matplotlib.rc_context({"font.size": 20.0, "axes.grid": True, "savefig.dpi": 50}):
        assert draw() == first


def test_spaced_frames_keep_their_distance():
    places = np.stack([np.linspace(0.0, 50.0, 100), np.zeros(100)], axis=1)
    chosen = spaced_frames(places, size=1.0)
    assert chosen[0] == 0
    assert chosen[-1] == 99
    assert 6 <= len(chosen) <= 9
    assert np.diff(places[list(chosen), 0]).min() > 3.0
    assert spaced_frames(np.zeros((7, 2)), size=1.0) == (6,)
    assert spaced_frames(np.zeros((1, 2)), size=1.0) == (0,)


def test_an_estimate_beside_the_target_is_not_cut_below_the_path(run):
    """Half a radius ahead of it: the rectangle of a scan comes after what it cuts."""
    track, headings = run["track"], run["scenario"].target_poses_world[:, None, 2]
    ahead = 1.2 * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    moved = replace(track, contours_world=track.contours_world + ahead)
    strip, outlines = path_figure(moved, run["scenario"], VIEW).axes[1], []
    for patch in strip.patches:
        if isinstance(patch, Rectangle):
            ends = np.concatenate(outlines)[:, 0]
            assert patch.get_x() <= ends.min() and ends.max() <= patch.get_x() + patch.get_width()
            outlines = []
        elif isinstance(patch, Polygon) and patch.get_edgecolor() == to_rgba(style.ESTIMATE):
            outlines.append(patch.get_xy())


def test_the_times_along_a_path_are_inside_its_axes(run):
    """The outer side of a turn is at the edge of the axes, which are as wide as the path."""
    scenario, track = run["scenario"], run["track"]
    angles = np.radians(np.linspace(150.0, 390.0, len(scenario.times)))
    places = 8.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1) + [0.0, 18.0]
    poses = np.column_stack([places, angles + 0.5 * np.pi])
    means = np.column_stack([poses, track.means[:, 3:]])
    scenario = replace(scenario, target_poses_world=poses)
    figure = path_figure(replace(track, means=means), scenario, VIEW)
    figure.draw_without_rendering()
    axes = figure.axes[0].get_window_extent()
    texts = [text for text in figure.axes[0].texts if text.get_text().endswith(" s")]
    assert len(texts) > 3
    for text in texts:
        box = text.get_window_extent()
        assert axes.x0 <= box.x0 and box.x1 <= axes.x1, text.get_text()
        assert axes.y0 <= box.y0 and box.y1 <= axes.y1, text.get_text()
