"""`stixel report SWEEP`: the page of a sweep made by hand, read, and used in a browser."""

import re
import shutil

import numpy as np
import pytest
from result_folders import make_folder

from stixel_cli.cli.report import report
from stixel_cli.errors import UserError
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.page import over_time
from stixel_cli.sweeps.results import SweepResult

VALUES, SEEDS = ("0.1", "0.4", "1.6"), ("0", "1", "2", "3")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a complete sweep of three values and two seeds, and its page."""
    root = tmp_path_factory.mktemp("sweep")
    folder = SweepFolder(root / "widths")
    runs = tuple((f"tracker.sigma_q={v}", f"seed={s}") for v in VALUES for s in SEEDS)
    axes = (("tracker.sigma_q",), ("seed",))
    notes = {"command": "stixel sweep tracker.sigma_q=0.1,0.4,1.6", "created": "2026"}
    folder.create(SweepRequest(str(root), None, False, (), axes, runs, notes))
    for index in range(len(runs)):
        metrics = {"track_lost": 0.0, "nis_mean": 0.5 + index, "iou_mean": 0.9 - 0.05 * index}
        make_folder(folder.run(index), index, metrics=metrics)
    (folder.run(2) / "index.html").write_text("<p>a run</p>")
    assert report([folder.path], root / "page.html") == 0
    return root


def test_the_page_has_every_setting_run_and_figure(made):
    html = (made / "page.html").read_text(encoding="utf-8")
    assert "12 of 12 runs done; 3 settings; means over seeds" in html
    rows = re.findall(r"<tr><td.*?</tr>", html, re.DOTALL)
    assert len(rows) == 3 + 12
    # The mean of 0.9, 0.85, 0.8 and 0.75, each 0.2 above that of the next value and the same seed.
    assert re.search(r'data-value="0.825">0.8\d?\n\[0.7', rows[0])
    assert re.search(r"Mean IoU: 0.1 \(0.8\d \[0.70.* is the best; 0.4 \(0.6.* is next, −0.2", html)
    assert 'href="widths/runs/0002/index.html"' in html
    assert 'href="widths/runs/0003"' in html
    assert html.count(' over tracker.sigma_q"') == 5
    # On a telephone of 390 px, with margins and a scroll bar.
    assert max(map(int, re.findall(r'min-width: (\d+)px"', html))) <= 350
    assert html.count(' over time"') == 6
    assert "stixel sweep tracker.sigma_q=0.1,0.4,1.6" in html
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html)


def test_an_incomplete_setting_has_no_statistics(made, tmp_path):
    folder = tmp_path / "widths"
    shutil.copytree(made / "widths", folder)
    shutil.rmtree(folder / "runs/0001")
    assert report([folder], tmp_path / "page.html") == 0
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "11 of 12 runs done; 3 settings, 1 incomplete: no statistics yet" in html
    settings = html[html.index('<table id="settings"') : html.index("Metrics over each axis")]
    assert settings.count("<tr><td") == 2
    for index in range(12):
        shutil.rmtree(folder / f"runs/{index:04d}", ignore_errors=True)
    with pytest.raises(UserError, match="no run is done; resume with: stixel sweep --resume"):
        report([folder], tmp_path / "none.html")
    assert not (tmp_path / "none.html").exists()


def test_settings_with_other_times_are_left_out_of_the_curves(made, tmp_path):
    folder = tmp_path / "widths"
    shutil.copytree(made / "widths", folder)
    np.savez(folder / "runs/0000/scores.npz", t=np.arange(3.0), iou=np.ones(3))
    runs = SweepFolder(folder).runs(SweepFolder(folder).request())
    assert len(over_time(SweepResult(folder, tuple(runs)))) == 6
    # Only the setting of the first four runs: nothing is left.
    assert over_time(SweepResult(folder, tuple(runs[:4]))) == []


def test_the_tables_can_be_sorted_and_filtered(made, open_page):
    opened = open_page(made / "page.html", 1280, 900)
    page = opened.page

    def column(number):
        return page.locator("#settings tbody tr:visible").evaluate_all(
            f"rows => rows.map(row => row.cells[{number}].textContent)"
        )

    assert column(0) == list(VALUES)
    head = page.locator("#settings th").first
    head.get_by_role("button").click()
    head.get_by_role("button").click()
    assert column(0) == list(VALUES[::-1]) and head.get_attribute("aria-sort") == "descending"
    page.locator("input[data-table=settings]").fill("0.4")
    assert column(0) == ["0.4"]
    assert page.locator("output").first.inner_text() == "1 of 3 rows"
    page.locator("input[data-table=settings]").fill("")
    assert page.locator(".ranking:visible").count() == 1
    page.locator("#metric").select_option("NIS / degrees of freedom, mean (1 is consistent)")
    assert "NIS" in page.locator(".ranking:visible .answer").inner_text()
    assert opened.problems == [] and opened.overflow() == 0
    page.close()
    small = open_page(made / "page.html", 390, 844, dark=True)
    assert small.overflow() == 0 and small.problems == []
    small.page.close()


def test_rows_are_grouped_by_a_key(tmp_path, open_page):
    folder = SweepFolder(tmp_path / "two")
    pairs = [(path, user) for path in ("turn", "circle") for user in ("car", "cyclist")]
    runs = tuple((f"path={path}", f"road_user={user}") for path, user in pairs)
    folder.create(SweepRequest("", None, False, (), (("path",), ("road_user",)), runs, {}))
    for index in range(4):
        make_folder(folder.run(index), index, metrics={"iou_mean": 0.1 * index})
    assert report([folder.path], tmp_path / "page.html") == 0
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Mean IoU: circle cyclist (0.300), circle car (0.200), turn cyclist" in html
    page = open_page(tmp_path / "page.html", 1280, 900).page
    page.locator("select[data-group=settings]").select_option("1")
    shown = page.locator("#settings tbody tr:visible").all_inner_texts()
    assert [shown[0], shown[3]] == ["road_user = car", "road_user = cyclist"]
    page.locator("input[data-table=settings]").fill("cyclist")
    shown = page.locator("#settings tbody tr:visible").all_inner_texts()
    assert len(shown) == 3 and shown[0] == "road_user = cyclist"
    page.close()


def test_every_setting_has_a_curve(tmp_path):
    folder = SweepFolder(tmp_path / "many")
    values = [f"value{i}" for i in range(19)]
    runs = tuple((f"path={value}",) for value in values)
    folder.create(SweepRequest("", None, False, (), (("path",),), runs, {}))
    for index in range(19):
        make_folder(folder.run(index), index, metrics={"iou_mean": 0.05 * index})
    found = SweepFolder(folder.path).runs(folder.request())
    lines = {}

    def drawn(axes, times, values, *rest, **look):
        lines.setdefault(id(axes), []).append(look["label"])

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("stixel_cli.report.charts.over_time", drawn)
        over_time(SweepResult(folder.path, tuple(found)))
    # Six errors, each in three panels.
    assert [len(labels) for labels in lines.values()] == [8, 8, 3] * 6
    assert {label for labels in lines.values() for label in labels} == set(values)
