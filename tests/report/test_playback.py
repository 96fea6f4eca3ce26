"""What the page that plays a run back holds; how it behaves is tested in a browser."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from importlib import resources
from itertools import pairwise

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from playback_runs import SCANS, composed_grid, make_run, with_objects, with_several_tracks
from report_nouns import make_camera_nouns, make_rig
from scipy.stats import chi2

from stixel_cli.config.compose import compose
from stixel_cli.geometry.pose import rotation
from stixel_cli.pictures import style
from stixel_cli.pictures.camera import WIDEST, camera_frames
from stixel_cli.pictures.uncertainty import normalised_chi_square_bounds
from stixel_cli.report import playback
from stixel_cli.report.metrics import json_in_html, number
from stixel_cli.report.playback import noise_of, playback_data, playback_html


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page, flags=re.DOTALL).group(1))


def template(name):
    return resources.files("stixel_cli.report").joinpath(f"templates/{name}").read_text("utf-8")


def test_page_contains_the_run_to_the_millimetre():
    run = make_run()
    data = data_of(playback_html([run], "a run"))
    (played,) = data["runs"]
    for k in range(SCANS):
        contour = 1e-3 * np.reshape(played["contours"][k], (-1, 2))
        assert np.abs(contour - run.track.contours_world[k]).max() <= 0.5001e-3
        rows = run.scans.rows(k)
        points = 1e-3 * np.reshape(data["scans"][0]["points"][k], (-1, 2))
        assert np.allclose(points, run.scans.points_world[rows], atol=0.5001e-3)
        used = run.track.used_points[slice(*run.track.used_offsets[k : k + 2])]
        assert np.array_equal(np.array(played["used"][k], int) + rows.start, used)
    assert np.allclose(
        np.array(data["target"])[:, :2], 1e3 * run.scenario.target_poses_world[:, :2], atol=0.5
    )
    assert played["errors"]["nis"][5] is None
    assert np.allclose(played["errors"]["iou"], run.scores.iou, atol=1e-4)
    assert data["times"] == pytest.approx(run.scenario.times)


def test_main_numbers_are_beside_those_of_the_points():
    run = make_run()
    metrics = {"iou_mean": 0.5, "iou_baseline": 0.25, "centre_rmse_m": 99.0}
    metrics |= {"nees_position_mean": 2.0, "orientation_rmse_deg": None}
    (played,) = playback_data([replace(run, metrics=metrics)], "a run")["runs"]
    assert [name for name, _ in played["summary"]][:2] == ["mean IoU", "centre RMSE"]
    iou, centre, nees = played["headline"]
    assert iou == ["mean IoU", "0.500", "baseline: 0.250"]
    assert nees == ["mean NEES / 2", "2.00", "consistent: 1.00"]
    used, offsets = run.track.used_points, run.track.used_offsets
    means = [run.scans.points_world[used[a:b]].mean(axis=0) for a, b in pairwise(offsets) if b > a]
    true = run.scenario.target_poses_world[np.diff(offsets) > 0, :2]
    rmse = np.sqrt(np.mean(np.sum((np.array(means) - true) ** 2, axis=1)))
    assert centre[2:] == [f"mean of its points: {number(rmse)} m"]


def test_ellipse_matches_its_covariance():
    run = make_run()
    data = playback_data([run], "a run")
    rows = run.scans.rows(2)
    for (major, minor, angle), covariance in zip(
        np.reshape(data["scans"][0]["ellipses"][2], (-1, 3)),
        run.scans.covariances_world[rows],
        strict=True,
    ):
        turn = rotation(angle / 1e3)
        again = turn @ np.diag([(major / 1e3) ** 2, (minor / 1e3) ** 2]) @ turn.T
        assert np.allclose(again, covariance, atol=3e-4)


def test_non_finite_values_are_null_and_diverged_estimates_are_omitted():
    run = make_run()
    contours, means = run.track.contours_world.copy(), run.track.means.copy()
    contours[3, 7, 0], contours[4], means[3, 1] = np.nan, 1e300, np.inf
    track = replace(run.track, contours_world=contours, means=means)
    scores = replace(run.scores, centre_error=np.full(SCANS, np.inf))
    (played,) = data_of(playback_html([replace(run, track=track, scores=scores)], "a"))["runs"]
    assert played["contours"][3] is played["contours"][4] is played["poses"][3] is None
    assert played["contours"][5] is not None
    assert set(played["errors"]["centre_error"]) == {None}


def test_names_are_escaped_and_the_page_is_repeatable_and_makes_no_request():
    name = "</script><script>alert('⟦data⟧')</script>\u2028&amp;<!--"
    page = playback_html([replace(make_run(), label=name)], name, [name])
    parser = HTMLParser()
    scripts = []
    parser.handle_starttag = lambda tag, _: scripts.append(tag) if tag == "script" else None
    parser.feed(page)
    assert len(scripts) == 2
    data = data_of(page)
    assert data["title"] == data["notes"][0] == data["runs"][0]["label"] == name
    assert json_in_html("<\u2028>&") == '"\\u003c\\u2028\\u003e\\u0026"'
    page = playback_html([make_run()], "a run")
    assert page == playback_html([make_run()], "a run")
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", page)
    assert "⟦" not in page


def test_runs_share_equal_scans_and_images():
    one, other = make_run("gp_ekf"), make_run("point", seed=1, corners=24)
    data = playback_data([one, other, make_run("blind", with_camera=False)], "three")
    assert [run["scan"] for run in data["runs"]] == [0, 0, 0]
    assert [run["camera"] for run in data["runs"]] == [0, 0, None]
    assert len(data["scans"]) == len(data["cameras"]) == 1
    moved = replace(other.scans, points_world=other.scans.points_world + 1.0)
    data = playback_data([one, replace(other, scans=moved)], "two")
    assert [run["scan"] for run in data["runs"]] == [0, 1]


def test_objects_of_a_recording_are_on_the_page():
    data = playback_data([make_run(), with_objects(make_run())], "two")
    plain, played = data["runs"]
    assert plain["boxes"] is None
    assert played["boxes"][:2] == [[4, 20, 10, 30], [5, 21, 10, 30, 6, 22, 10, 30]]
    assert len(played["boxes"]) == SCANS
    assert plain["tracks"] == [] == data["truths"]


def test_several_tracks_are_on_the_page_with_the_labels_and_without_a_track_of_the_run():
    run = with_several_tracks(make_run())
    data = playback_data([run], "several")
    (played,) = data["runs"]
    assert "poses" not in played and data["extent"] > 1000
    short, whole = played["tracks"]
    assert (short["first"], whole["first"]) == (3, 0)
    contours = make_run().track.contours_world[3:6]
    assert_allclose(1e-3 * np.reshape(short["contours"], contours.shape), contours, atol=1e-3)
    # Its points are numbered in its scans.
    assert short["used"] == whole["used"][3:6]
    assert (short["classes"], whole["classes"]) == ({}, {"car": 0.995, "cyclist": 0.005})
    (label,) = data["truths"]
    box = make_run().scenario.boxes_world[4]
    assert label["name"] == "7"
    assert_allclose(1e-3 * np.reshape(label["boxes"][4], (4, 2)), box, atol=1e-3)


def test_long_run_shows_every_nth_image(monkeypatch):
    run = make_run()
    camera = playback_data([run], "a")["cameras"][0]
    assert (camera["every"], camera["frames"]) == (1, list(range(SCANS)))
    for name in ("grey", "disparity", "grid", "free_space"):
        assert base64.b64decode(camera["images"][name][11]) == run.camera[1].images[name][1]
    whole = sum(len(text) for texts in camera["images"].values() for text in texts)
    monkeypatch.setattr(playback, "IMAGE_BUDGET", whole // 3)
    monkeypatch.setattr(playback, "MOST_ELLIPSES", 10)
    data = playback_data([run], "a")
    camera = data["cameras"][0]
    assert camera["every"] >= 3
    assert camera["frames"] == list(range(0, SCANS, camera["every"]))
    assert sum(len(t) for texts in camera["images"].values() for t in texts) <= whole // 3
    assert len(camera["stixels"]) == len(camera["images"]["free_space"])
    assert data["scans"][0]["ellipses"] is None


def test_camera_frames_contain_small_images_and_stixels():
    rig = make_rig(640, 480)
    _, *nouns = make_camera_nouns(rig, np.random.default_rng(0), first=4, count=3)
    pairs, _, _, stixels = nouns
    frames = camera_frames(*nouns, rig, *composed_grid(), range(5, 7))
    again = camera_frames(*nouns, rig, *composed_grid(), range(5, 7))
    assert frames.images == again.images
    views = {
        name: cv2.imdecode(np.frombuffer(files[0], np.uint8), cv2.IMREAD_COLOR).astype(int)
        for name, files in frames.images.items()
    }
    # The box in the middle ends the free space; the sky is not tinted; the grid has its line.
    green = {name: view[..., 1] - view[..., 2] for name, view in views.items()}
    assert green["free_space"][-20:].mean() > 20.0 > 5.0 > abs(green["free_space"][:80].mean())
    assert (green["grid"] > 30).any() and (views["grid"].sum(2) > 700).mean() > 0.3
    assert np.ptp(views["disparity"], axis=2).mean() > 20.0
    assert (frames.first, frames.width, frames.height) == (5, 640, 480)
    image = cv2.imdecode(np.frombuffer(frames.images["grey"][0], np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image.shape == (WIDEST * 480 // 640, WIDEST)
    small = cv2.resize(pairs.left[1], image.shape[::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(image.astype(float) - small).mean() < 3.0
    first, last = stixels.rows(1).start, stixels.rows(2).stop
    assert np.array_equal(frames.left, stixels.left[first:last])
    assert frames.offsets.tolist() == [0, len(frames.left) // 2, len(frames.left)]


def test_normalised_bounds_approximate_chi_square():
    n = np.array([2, 4, 20, 180])
    exact = np.stack([chi2.ppf(p, n) / n for p in (0.025, 0.975)])
    near = normalised_chi_square_bounds(n)
    assert np.allclose(near[:, 0], exact[:, 0])
    assert np.allclose(near[:, 1], exact[:, 1], rtol=0.1)
    assert np.allclose(near[:, 2:], exact[:, 2:], rtol=0.01)
    assert np.isnan(normalised_chi_square_bounds(np.array([0]))).all()


def test_page_uses_the_colours_of_the_figures():
    light = template("playback.css").partition("@media")[0]
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", light))
    for name in ("truth", "estimate", "used", "unused", "ego", "consistent"):
        assert colours[name] == getattr(style, name.upper()), name
    assert colours["field-of-view"] == style.FIELD_OF_VIEW
    # Those of several runs are told apart from the points that were used.
    assert style.USED not in {colours[f"run-{i}"] for i in range(4)} <= set(style.RUNS)
    runs = re.findall(r"--run-(\d): (#[0-9a-f]{6})", template("page.css").partition("@media")[0])
    assert [colour for _, colour in sorted(runs)] == [*style.RUNS]
    script = template("playback_camera.js") + template("playback_paths.js")
    hexes = re.findall(r'"([0-9a-f]{6})"', script)
    depths = np.geomspace(style.DEPTH_TICKS[0], style.DEPTH_TICKS[-1], len(hexes))
    expected = np.rint(255 * style.depth_colours(depths)).astype(int)
    assert [f"{r:02x}{g:02x}{b:02x}" for r, g, b in expected] == hexes


@pytest.fixture
def noise():
    def of(*overrides):
        return noise_of(replace(make_run(), composition=compose(overrides)))

    return of


def test_an_isotropic_noise_is_one_number_and_the_scan_s_own_is_not_stored_again(noise):
    assert noise("tracker.measurement_std=0.4")["std"] == 400
    for kind in ("point", "box"):
        assert noise(f"tracker={kind}", "tracker.measurement_std=0.25")["std"] == 250
    found = noise("tracker=gm_mem_ekf")
    assert found["std"] is found["ellipses"] is None


def test_added_and_stretched_noise_have_own_ellipses(noise, monkeypatch):
    run = make_run()
    used = run.track.used_points[slice(*run.track.used_offsets[2:4])]
    covariances = run.scans.covariances_world[used]
    of_each = [
        noise(f"tracker={kind}", "tracker.measurement_std=0.3")["ellipses"][2]
        for kind in ("pyrecest", "rectangle")
    ]
    assert of_each[0] == of_each[1]
    added = np.reshape(of_each[0], (-1, 3))
    with monkeypatch.context() as patch:
        patch.setattr(playback, "MOST_OF_NOISE", 10)
        many = noise("tracker=pyrecest")
    assert many["ellipses"] is None and many["text"].endswith("too many points to show it")
    traces = (added[:, :2] ** 2).sum(axis=1) / 1e6
    assert traces == pytest.approx(np.trace(covariances, axis1=1, axis2=2) + 0.18, rel=0.01)
    stretched = noise("tracker=contour", "tracker.noise_factor=3.0")
    major = np.reshape(stretched["ellipses"][2], (-1, 3))[:, 0] / 1e3
    # The made scans have their noise along the ray.
    assert major == pytest.approx(3.0 * np.sqrt(np.linalg.eigvalsh(covariances)[:, 1]), rel=0.05)
