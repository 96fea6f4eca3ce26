"""The page that plays a run back, in a browser: sizes, charts, legible text, footer.

Skipped, with the reason, where there is no browser.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from playback_page import frame
from playback_runs import SCANS, make_run

from stixel_cli.report.playback import playback_html

expect = pytest.importorskip("playwright.sync_api", reason="playwright is not installed").expect


def test_charts_have_units_end_ticks_and_badges(open_page, tmp_path):
    run = make_run("gp_ekf")
    metrics = run.scores.metrics | {"nees_position_mean": 4.2, "nis_mean": 1.0}
    scores = replace(run.scores, metrics=metrics | {"time_to_loss_s": 0.5})
    file = tmp_path / "page.html"
    file.write_text(playback_html([replace(run, scores=scores)], "badges"), "utf-8")
    page = open_page(file, 1280, 900).page
    charts = page.locator(".chart")
    texts = charts.first.locator("svg text")
    # It waits until the charts are drawn.
    expect(texts.last).to_have_text(f"{run.scenario.times[-1]:g} s")
    assert any(re.fullmatch(r"[\d.]+ m", text) for text in texts.all_text_contents())
    badges = page.locator(".badge").all_inner_texts()
    assert badges == ["lost at 0.5 s"]


def test_a_page_states_where_it_comes_from(open_page, tmp_path):
    made = {"command": "stixel run seed=<3>", "created": "2026-01-02", "versions": {"stixel": "9"}}
    made["git"] = {"revision": "0123456789abcdef", "dirty": True}
    run = make_run()
    file = tmp_path / "page.html"
    file.write_text(
        playback_html([replace(run, manifest=run.manifest | made)], "origin"), encoding="utf-8"
    )
    opened = open_page(file)
    footer = opened.page.locator("#origin")
    said = footer.inner_text()
    for text in ("stixel run seed=<3>", "0123456789ab with uncommitted changes", "2026-01-02"):
        assert text in said
    links = footer.locator("a").evaluate_all("all => all.map(a => a.getAttribute('href'))")
    assert links == ["figures/", "metrics.json", "config.yaml"]


def test_a_desktop_shows_all_panels_without_scrolling(open_page, pages):
    for name in ("one", "two", "blind"):
        page = open_page(pages / f"{name}.html", 1280, 900).page
        lowest = page.locator(".chart").evaluate_all(
            "all => Math.max(...all.map(e => e.getBoundingClientRect().bottom))"
        )
        assert lowest < page.locator("#controls").bounding_box()["y"], name
        assert page.locator("#map").bounding_box()["height"] > 350


def test_page_respects_reduced_motion(open_page, pages):
    opened = open_page(pages / "one.html", still=True)
    page = opened.page
    assert page.evaluate("matchMedia('(prefers-reduced-motion: reduce)').matches")
    for press in ("One scan forward", "Zoom in", "Whole scene"):
        page.get_by_role("button", name=press).click()
        # A transition would be running now; the map and the cursors are where they will stay.
        assert page.evaluate("document.getAnimations().length") == 0
    places = "[...document.querySelectorAll('#world, .cursor')].map(e => e.outerHTML).join()"
    before = page.evaluate(places)
    opened.settle()
    assert page.evaluate(places) == before and frame(page) == 1
    # Playing is asked for, and still plays.
    page.get_by_role("button", name="Play", exact=True).click()
    expect(page.locator("#scrub")).to_have_value(re.compile("[3-9]"))
    page.get_by_role("button", name="Pause").click()


def test_touch_targets_are_large_enough(open_page, pages):
    """44 px a side, on a phone, and the page does not become wider for it."""
    opened = open_page(pages / "two.html", 390, 844, touch=True)
    small = opened.page.evaluate(
        "[...document.querySelectorAll('button, select, input[type=range], label')]"
        ".filter(e => e.checkVisibility()).map(e => [e.id, e.getBoundingClientRect()])"
        ".filter(([, box]) => Math.min(box.width, box.height) < 44).map(([id]) => id)"
    )
    assert small == []
    assert opened.overflow() == 0


def test_charts_are_aligned_and_bands_have_no_gaps(one):
    page = one.page
    for width in (1206, 1280, 1400, 1500):
        page.set_viewport_size({"width": width, "height": 900})
        boxes = [plot.bounding_box() for plot in page.locator(".plot").all()]
        assert len(boxes) == 7
        assert max(box["x"] for box in boxes) - min(box["x"] for box in boxes) < 1.0, width
        assert min(box["width"] for box in boxes) > 280.0, width
    one.settle()
    band = page.locator(".plot").nth(4).locator(".consistent").get_attribute("d")
    steps = np.array(re.findall(r"M(\S+) \S+H([\d.]+)V", band), dtype=float)
    assert len(steps) == SCANS
    assert (steps[1:, 0] <= steps[:-1, 1]).all()


@pytest.mark.parametrize(
    ("name", "size", "dark"),
    [
        ("one", (390, 844), False),
        ("one", (1440, 900), True),
        ("two", (390, 844), True),
        ("two", (1440, 900), False),
    ],
)
def test_page_fits_a_phone_and_a_desktop(open_page, pages, name, size, dark):
    opened = open_page(pages / f"{name}.html", *size, dark=dark)
    page = opened.page
    assert opened.overflow() == 0
    assert page.locator("#play").is_visible()
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (max(map(int, re.findall(r"\d+", paper))) < 60) == dark
    small = page.evaluate(
        "[...document.querySelectorAll('body *')].filter(e => e.checkVisibility() && "
        "[...e.childNodes].some(n => n.nodeType === 3 && n.data.trim()) && "
        "parseFloat(getComputedStyle(e).fontSize) < 10 && parseFloat(getComputedStyle(e).fontSize))"
        ".filter(e => !['SCRIPT', 'OPTION'].includes(e.tagName)).map(e => e.outerHTML.slice(0, 80))"
    )
    assert small == []


@pytest.mark.parametrize("dark", [False, True])
def test_values_of_every_run_are_legible(open_page, tmp_path, dark):
    """WCAG 2.2's contrast of text, 4.5, of the colours as they come out on the screen."""
    page_file = tmp_path / "four.html"
    runs = [make_run(name, seed, with_camera=False) for seed, name in enumerate("abcd")]
    page_file.write_text(playback_html(runs, "four"), encoding="utf-8")
    opened = open_page(page_file, dark=dark)
    seen = opened.page.evaluate(
        """() => {
            const canvas = document.createElement("canvas");
            const pen = canvas.getContext("2d", { willReadFrequently: true });
            const bytes = (colour) => {
                pen.fillStyle = colour;
                pen.fillRect(0, 0, 1, 1);
                return [...pen.getImageData(0, 0, 1, 1).data].slice(0, 3);
            };
            const card = document.querySelector(".chart");
            return [card, ...card.querySelectorAll(".value")].map((element, i) => {
                const style = getComputedStyle(element);
                return bytes(i ? style.color : style.backgroundColor);
            });
        }"""
    )
    share = np.array(seen) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    background, *texts = linear @ (0.2126, 0.7152, 0.0722) + 0.05
    assert len(texts) == 4
    assert all(max(text, background) / min(text, background) >= 4.5 for text in texts)
