"""The page that plays a run back, in a browser: it plays, steps, scrubs, and draws what is stored.

Skipped, with the reason, where there is no browser.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from playback_page import LAST, drawn, frame, to
from playback_runs import make_run

from stixel_cli.report.playback import playback_html

expect = pytest.importorskip("playwright.sync_api", reason="playwright is not installed").expect


def test_page_plays_to_the_end_and_pauses(one):
    page = one.page
    assert page.locator("#now").inner_text() == "k = 0, t = 0.00 s"
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.locator("#scrub")).to_have_value(re.compile("[2-9]"))
    page.get_by_role("button", name="Pause").click()
    there = frame(page)
    assert there >= 2
    page.get_by_label("Speed").select_option("4")
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.locator("#scrub")).to_have_value(str(LAST))
    assert page.get_by_role("button", name="Play", exact=True).is_visible()
    assert page.get_by_role("button", name="One scan forward").is_disabled()


def test_page_steps_by_buttons_and_keys(one):
    page = one.page
    page.get_by_role("button", name="One scan forward").click()
    assert frame(page) == 1
    page.locator("h1").click()
    for key, expected in (
        ("ArrowRight", 2),
        ("Shift+ArrowRight", LAST),
        ("ArrowLeft", LAST - 1),
        ("Home", 0),
        ("End", LAST),
    ):
        page.keyboard.press(key)
        assert frame(page) == expected, key
    page.keyboard.press("Home")
    page.keyboard.press("Space")
    expect(page.locator("#scrub")).to_have_value(re.compile("[1-9]"))
    page.keyboard.press("Space")
    assert page.get_by_role("button", name="Play", exact=True).is_visible()


@pytest.mark.parametrize("k", [3, 5])
def test_page_draws_the_stored_data(one, k):
    page, run = one.page, make_run()
    to(page, k)
    assert np.allclose(drawn(page, "estimate-0"), run.track.contours_world[k], atol=0.6e-3)
    truth = run.scenario.contour_world(k)
    assert np.allclose(drawn(page, "truth"), truth, atol=2e-3)
    used = run.track.used_points[slice(*run.track.used_offsets[k : k + 2])]
    text = page.locator("#points-used").get_attribute("d")
    dots = np.array(re.findall(r"M(\S+) (\S+?)h0", text), dtype=float).reshape(-1, 2)
    assert np.allclose(dots, run.scans.points_world[used], atol=0.6e-3)
    assert page.locator("#points-unused").get_attribute("d").count("M") == (0 if k == 5 else 2)
    if k == 3:
        on_screen = page.locator("#estimate-0").bounding_box()
        picture = page.locator("#map").bounding_box()
        assert picture["x"] < on_screen["x"]
        assert on_screen["x"] + on_screen["width"] < picture["x"] + picture["width"]
        assert on_screen["width"] > 0.15 * picture["width"]
    else:
        assert "Empty scan" in page.locator("#scan-caption").inner_text()
    error = page.locator(".chart .value").first.inner_text()
    assert error == f"{run.scores.centre_error[k]:.3f} m"


def test_camera_shows_image_and_stixels_of_the_frame(one):
    page, run = one.page, make_run()
    to(page, 11)
    expect(page.locator("#image")).to_have_js_property("naturalWidth", 160)
    assert page.locator("#image").get_attribute("alt").endswith("k = 11")
    camera, rows = run.camera[1], slice(*run.camera[1].offsets[1:3])
    shown = page.locator("#stixels rect:not([style*='none'])")
    assert shown.count() == rows.stop - rows.start > 0
    assert float(shown.first.get_attribute("x")) == camera.left[rows][0] - 0.5
    page.get_by_role("checkbox", name="Stixels").uncheck()
    assert not shown.first.is_visible()
    for view in ("disparity", "occupancy grid", "free space"):
        page.get_by_role("combobox", name="What is shown").select_option(view)
        expect(page.locator("#image")).to_have_js_property("naturalWidth", 160)
        assert view in page.locator("#camera-caption").inner_text()
        assert page.locator("#footprints").is_visible() == (view != "occupancy grid")


def test_the_stixels_of_the_target_are_outlined_and_the_rest_dimmed(open_page, tmp_path):
    run = make_run()
    rig, chunk = run.composition.configuration.rig, run.camera[0]
    rows = slice(*chunk.offsets[2:4])
    # Two of the stixels of scan 2 are put on the true centre.
    pose = run.scenario.ego_poses_world[2]
    apart = run.scenario.target_poses_world[2, :2] - pose[:2]
    ahead = apart @ (np.cos(pose[2]), np.sin(pose[2]))
    right = apart @ (np.sin(pose[2]), -np.cos(pose[2]))
    column = round(rig.u0 + rig.focal * right / ahead)
    left, ends, depth = chunk.left.copy(), chunk.right.copy(), chunk.depth.copy()
    left[rows][:2], ends[rows][:2], depth[rows][:2] = (column, column + 1), column + 1, ahead
    ends[rows][1] += 1
    camera = (replace(chunk, left=left, right=ends, depth=depth), *run.camera[1:])
    file = tmp_path / "page.html"
    file.write_text(playback_html([replace(run, camera=camera)], "target"), encoding="utf-8")
    page = open_page(file).page
    to(page, 2)
    shown = page.locator("#stixels rect:not([style*='none'])")
    fills = shown.evaluate_all("all => all.map(e => Number(e.getAttribute('fill-opacity')))")
    assert len(fills) > 2 and [fill > 0.3 for fill in fills] == [True] * 2 + [False] * (
        len(fills) - 2
    )
    text = page.locator("#target-outline").get_attribute("d")
    outline = np.array(re.findall(r"[ML](\S+) ([^MLZ]+)", text), dtype=float)
    # One outline round both, half a pixel outside of the pixels' centres.
    assert text.count("M") == 1 and len(outline) == 8
    assert [outline[:, 0].min(), outline[:, 0].max()] == [column - 0.5, column + 1.5]
    assert outline[:, 1].min() == chunk.top[rows][:2].min() - 0.5
    assert "2 on the target, outlined" in page.locator("#camera-caption").inner_text()
    # The zoom keeps the edge of the image at the edge of its frame.
    zoom, lens = page.get_by_role("button", name="Zoom to the target"), page.locator("#lens")
    zoom.click()
    transform = lens.get_attribute("style").partition("transform")[2]
    x, y, scale = map(float, re.findall(r"(-?[\d.]+)[%)]", transform))
    assert scale > 1.5 and 100 - 100 * scale <= x <= 0 and 100 - 100 * scale <= y <= 0
    zoom.click()
    assert "scale" not in lens.get_attribute("style")


def test_used_points_have_the_trackers_noise_and_footprints_are_on_the_road(one):
    page, run = one.page, make_run()
    to(page, 3)
    std = run.composition.configuration.tracker.measurement_std
    text = page.locator("#ellipses-used").get_attribute("d")
    radii = np.array(re.findall(r"A(\S+) ", text), dtype=float)
    assert len(radii) and radii == pytest.approx(std)
    # The other points have the covariance that the scan states.
    unused = page.locator("#ellipses-unused").get_attribute("d")
    assert np.array(re.findall(r"A(\S+) ", unused), dtype=float) == pytest.approx(0.2)
    assert f"with R = (measurement_std, {std:.3g} m)²" in page.locator("#scan-caption").inner_text()
    rig = run.composition.configuration.rig
    for k in (0, 7):
        to(page, k)
        for name, contour in (
            ("foot-truth", run.scenario.contour_world(k)),
            ("foot-0", run.track.contours_world[k]),
        ):
            world = np.column_stack([contour, np.zeros(len(contour)), np.ones(len(contour))])
            pose = run.scenario.ego_poses_world[k]
            x, y, z = np.linalg.solve(rig.world_from_camera(pose), world.T)[:3]
            expected = np.stack([rig.u0 + rig.focal * x / z, rig.v0 + rig.focal_v * y / z], axis=1)
            text = page.locator(f"#{name}").get_attribute("d")
            found = np.array(re.findall(r"[ML](\S+) ([^MLZ]+)", text), dtype=float)
            assert np.allclose(found, expected, atol=0.5), (k, name)
    assert page.locator("#footprints").is_visible()


def test_charts_show_the_values_under_the_pointer_and_follow_it_and_the_image_may_be_wide(one):
    page = one.page
    before, plot = frame(page), page.locator(".plot").first
    box = plot.bounding_box()
    page.mouse.move(box["x"] + box["width"] - 9, box["y"] + box["height"] / 2)
    value = page.locator(".chart .value").first
    assert frame(page) == before
    hovered = plot.locator(".hovered").inner_html()
    page.mouse.down()
    page.mouse.up()
    assert frame(page) == LAST
    assert hovered.endswith(f"s: {value.inner_text()}")
    page.mouse.move(0, 0)
    assert plot.locator(".hovered").count() == 0
    box = page.locator(".plot").first.bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 40, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, middle, steps=3)
    assert 3 < frame(page) < LAST - 2
    page.mouse.move(box["x"] + box["width"], middle, steps=2)
    page.mouse.up()
    assert frame(page) == LAST
    width = page.locator("#camera").bounding_box()["width"]
    page.get_by_role("button", name="Wide").click()
    assert page.locator("#camera").bounding_box()["width"] > 1.5 * width
    page.get_by_role("button", name="Wide").click()
    assert page.locator("#camera").bounding_box()["width"] == width


def test_map_zooms_moves_and_shows_the_whole_scene(one):
    page = one.page

    def width():
        return page.locator("#truth").bounding_box()["width"]

    box = page.locator("#map").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before = width()
    page.mouse.move(x, y)
    transform = page.locator("#world").get_attribute("transform")
    page.mouse.wheel(0, -300)
    expect(page.locator("#world")).not_to_have_attribute("transform", transform)
    assert width() > 1.3 * before
    left = page.locator("#truth").bounding_box()["x"]
    page.mouse.down()
    page.mouse.move(x + 60, y, steps=2)
    page.mouse.up()
    assert page.locator("#truth").bounding_box()["x"] == pytest.approx(left + 60, abs=1.5)
    page.get_by_role("button", name="Reset the view").click()
    assert width() == pytest.approx(before, abs=1.0)
    whole = page.get_by_role("button", name="Whole scene")
    whole.click()
    assert whole.get_attribute("aria-pressed") == "true"
    assert width() < 0.6 * before


def test_page_overlays_two_runs(open_page, pages):
    page = open_page(pages / "two.html").page
    to(page, 7)
    for r, run in enumerate((make_run("gp_ekf"), make_run("point", seed=1, corners=24))):
        assert np.allclose(drawn(page, f"estimate-{r}"), run.track.contours_world[7], atol=0.6e-3)
        text = page.locator("#legend").inner_text()
        assert run.label in text
    colours = page.evaluate(
        "[0, 1].map(r => getComputedStyle(document.getElementById(`estimate-${r}`)).stroke)"
    )
    assert colours[0] != colours[1]
    assert page.locator(".chart").first.locator(".value").count() == 2
    page.get_by_label("Points and image of").select_option("point")


def test_map_points_to_an_estimate_outside_it(open_page, tmp_path):
    run = make_run("away")
    away = np.array([30.0, -40.0])
    means = run.track.means.copy()
    means[:, :2] += away
    track = replace(run.track, means=means, contours_world=run.track.contours_world + away)
    file = tmp_path / "away.html"
    file.write_text(playback_html([make_run("held"), replace(run, track=track)], "two"), "utf-8")
    page = open_page(file).page
    to(page, 5)
    assert not page.locator("#far-0").is_visible() and not page.locator("#outside-0").is_visible()
    off = np.linalg.norm(means[5, :2] - run.scenario.target_poses_world[5, :2])
    assert page.locator("#far-1").text_content() == f"{off:.1f} m off"
    picture, pointer = (page.locator(name).bounding_box() for name in ("#map", "#outside-1"))
    middle = [picture[side] + picture[size] / 2 for side, size in (("x", "width"), ("y", "height"))]
    # To the right and down, and in the picture.
    assert middle[0] < pointer["x"] < picture["x"] + picture["width"] - pointer["width"]
    assert middle[1] < pointer["y"] < picture["y"] + picture["height"] - pointer["height"]
    said = page.locator("#scan-caption").inner_text()
    assert said == "Empty scan: the track is a prediction."


def test_chosen_run_selects_points_image_and_count(open_page, pages):
    page = open_page(pages / "unlike.html").page
    counts = page.locator(".chart").last.locator(".curve").first
    of_the_first = counts.get_attribute("d")
    said = page.locator("#camera-caption").inner_text()
    assert "stixels" in said
    choice = page.get_by_label("Points and image of")
    choice.select_option("fewer")
    assert counts.get_attribute("d") != of_the_first
    assert page.locator("#camera-caption").inner_text() == ""
    choice.select_option("gp_ekf")
    assert counts.get_attribute("d") == of_the_first
    assert page.locator("#camera-caption").inner_text() == said


def test_space_plays_after_a_click_on_a_button(one):
    page = one.page
    page.get_by_role("button", name="One scan forward").click()
    page.get_by_role("checkbox", name="Stixels").click()
    page.get_by_role("button", name="Whole scene").click()
    page.keyboard.press("Space")
    expect(page.locator("#scrub")).to_have_value(re.compile("[2-9]"))
    page.keyboard.press("Space")
    # A button reached by keys is pressed by the space bar, as anywhere.
    there = frame(page)
    page.get_by_role("button", name="One scan back").focus()
    page.keyboard.press("Space")
    assert frame(page) == there - 1
    assert page.get_by_role("button", name="Play", exact=True).is_visible()


def test_page_reports_a_run_without_images_and_outlines_objects(open_page, pages):
    opened = open_page(pages / "blind.html")
    said = opened.page.locator("#no-camera")
    assert said.inner_text() == 'No camera image: the measurement "fabricated" uses no camera.'
    assert not opened.page.locator("#image").is_visible()
    opened = open_page(pages / "objects.html")
    outlines = opened.page.locator("#object-outlines")
    assert outlines.get_attribute("d") == "M3.5 9.5H19.5V30.5H3.5Z"
    to(opened.page, 1)
    assert outlines.get_attribute("d") == "M4.5 9.5H20.5V30.5H4.5ZM5.5 9.5H21.5V30.5H5.5Z"
    assert "object: stixels near each other" in opened.page.locator("#legend").inner_text()


def test_each_of_several_tracks_has_its_colour_and_its_number_and_labels_are_drawn(
    open_page, pages
):
    page = open_page(pages / "several.html").page
    for k, shown in ((2, False), (3, True), (5, True), (6, False)):
        to(page, k)
        assert bool(page.locator("#estimate-0").get_attribute("d")) == shown
        assert page.locator("#estimate-1").get_attribute("d")
        assert page.locator("#label-boxes").get_attribute("d")
        names = page.locator("#labels text").all_text_contents()
        assert ("track 0" in names) == shown and {"track 1", "label 7"} <= set(names)
    colours = {page.locator(f"#estimate-{n}").evaluate("e => e.style.stroke") for n in (0, 1)}
    assert len(colours) == 2
    legend = page.locator("#legend").inner_text()
    for text in ("track 0, class unknown", "track 1, class car", "label of the recording"):
        assert text in legend
    assert page.locator("#source-choice").is_hidden()
