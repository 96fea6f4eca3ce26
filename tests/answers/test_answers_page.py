"""The page of many runs: of any number of options and scenarios it is three screens long."""

import itertools
import re

import numpy as np
import pytest
from test_answer import CENTRE, IOU, frame_of, of_values

from stixel_cli.answers import render
from stixel_cli.answers.page import Asked, answers_page
from stixel_cli.answers.runs import Runs

SIGMA, LENGTH, NOISE = (f"tracker.{name}" for name in ("sigma_f", "length_scale", "slip"))


def made(axes):
    """Runs of all combinations of `axes`; some failed, each with a folder."""
    rng = np.random.default_rng(0)
    rows = [
        (*values, None if i % 97 == 5 else rng.uniform(0.4, 0.9))
        for i, values in enumerate(itertools.product(*axes.values()))
    ]
    frame = frame_of(rows, tuple(axes))
    return Runs(frame.assign(folder=[f"runs/{i:04d}" for i in frame.index], **{CENTRE: 0.1}))


FEW = {"tracker": ("contour", "gp_ekf", "point"), "path": [f"path_{i}" for i in range(9)]}
MANY = {
    "tracker.name": ("decorrelated_scgp", "factorised_giw", "mem_ekf_star"),
    SIGMA: (0.05, 0.1, 0.15, 0.45),
    LENGTH: (0.2, 0.4, 0.8),
    NOISE: (1.0, 2.0, 4.0),
    "path": ("turn", "crossing", "approach"),
}


def page_of(runs):
    links = {folder: f"{folder}/index.html" for folder in runs.frame["folder"]}
    origin = {"command": "stixel sweep " + "a.b=0.1,0.2 " * 99, "created": "now", "revision": "0"}
    remarks = [f"run_{i}: the target leaves the field of view at 4.1 s." for i in range(40)]
    return answers_page(Asked("Sweep of it", runs, runs.answers(), remarks, origin), links, ["a"])


@pytest.mark.drawn
@pytest.mark.parametrize(("axes", "seeds"), [(FEW, 4), (MANY, 4), (MANY, 2)])
def test_a_page_is_three_screens_long_and_the_first_one_compares(axes, seeds, tmp_path, open_page):
    file = tmp_path / "page.html"
    file.write_text(page_of(made(axes | {"seed": range(seeds)})), encoding="utf-8")
    opened = open_page(file, 1280, 800)
    assert opened.page.evaluate("document.documentElement.scrollHeight") <= 3 * 800
    assert opened.overflow() == opened.page.locator(".scroll [data-metric] figure").count() == 0
    first = opened.page.locator("table").first
    assert first.locator("tbody tr").count() == len(runs_options(axes))
    # The link to the worst run is on the first screen, too, without scrolling.
    place = first.locator("tbody tr a").first.bounding_box()
    assert place["y"] + place["height"] < 800 and place["x"] + place["width"] < 1280
    headings = [one.inner_text() for one in opened.page.locator("h2").all()]
    wanted = ["Values and differences", "By scenario", "All runs"]
    assert [text for text in headings if text in wanted] == wanted
    assert open_page(file, 390, 844, dark=True).overflow() == 0


def runs_options(axes):
    """Values of what is compared."""
    compared = (values for name, values in axes.items() if name != "path")
    return [*itertools.product(*compared)]


@pytest.mark.sketched
def test_the_longer_side_of_the_scenarios_is_down():
    def first_column(axes):
        table = re.search(r"By scenario.*?</table>", page_of(made(axes | {"seed": range(4)})), re.S)
        return re.findall(r'<tr><td class="">(.*?)</td>', table[0])

    paths = FEW["path"]
    assert [name.removesuffix(" (left out)") for name in first_column(FEW)] == paths
    assert len(first_column(FEW | {"path": paths[:2]})) == 3


def test_differences_follow_the_values_of_the_first_metric():
    runs = of_values({"a": {"turn": [0.9, 0.8, 0.9, 0.8]}, "b": {"turn": [0.5, 0.4, 0.6, 0.3]}})
    cells = render.overview(runs.answers([IOU, "track_lost"]), paired=True)
    assert cells.header[2:4] == ("mean IoU, box [95 %]", "minus a [95 %]")
    assert [row[3][:5] for row in cells.rows] == ["–", "−0.40"]
    assert cells.best[0] == (False, False, True, False, False)
    few = of_values({"a": {"turn": [0.9]}, "b": {"turn": [0.5]}})
    assert len(render.overview([few.ask()], paired=True).header) == 3


def test_the_failures_of_all_options_are_one_note():
    runs = of_values(
        {name: {"turn": [0.5] * 4 + [None] * (1 + i)} for i, name in enumerate("abcdef")}
    )
    assert runs.ask().notes[-1] == (
        "Failed: a 1 of 5 runs, b 2 of 6 runs, c 3 of 7 runs, d 4 of 8 runs and 2 more; counted as "
        "lost in the track loss rate, and in no other value."
    )


def test_a_figure_has_a_line_for_each_unit_and_none_for_each_option():
    counts = set()
    for options in (2, 9):
        values = {f"{i}": {"turn": [0.1 * i, 0.02, 0.3, 0.1]} for i in range(options)}
        axes = of_values(values).ask().figure().axes
        assert len(axes[0].lines[-1].get_xdata()) == options
        assert [len(one.collections[0].get_paths()) for one in axes] == [options, options - 1]
        counts.add(tuple(len(one.lines) for one in axes))
    assert counts == {(4 + 1, 2)}


@pytest.mark.sketched
def test_the_names_of_runs_are_no_axis():
    frame = made({"run": ("1", "2", "3", "4")}).frame
    assert "Over each axis" in page_of(Runs(frame, ("run",)))
    runs = Runs(frame.set_index("run", drop=False), ("run",), {"compare": "run"})
    assert "Over each axis" not in page_of(runs)
