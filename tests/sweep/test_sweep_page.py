"""`stixel report SWEEP`: the page of a sweep made by hand, read, and used in a browser."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from result_folders import make_folder

from stixel_cli.answers.figures import SHARES, over_time
from stixel_cli.cli.report import report
from stixel_cli.errors import UserError
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest, read_sweep

pytestmark = pytest.mark.drawn

VALUES, SEEDS = ("0.1", "0.4", "1.6"), ("0", "1", "2", "3")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a complete sweep of three values and two seeds, and its page."""
    root = tmp_path_factory.mktemp("sweep")
    folder = SweepFolder(root / "widths")
    runs = tuple((f"tracker.sigma_q={v}", f"seed={s}") for v in VALUES for s in SEEDS)
    axes = (("tracker.sigma_q",), ("seed",))
    notes = {"command": "stixel sweep tracker.sigma_q=0.1,0.4,1.6", "created": "2026"}
    folder.create(SweepRequest(str(root), False, (), axes, runs, notes))
    for index in range(len(runs)):
        metrics = {"track_lost": 0.0, "nis_mean": 0.5 + index, "iou_mean": 0.9 - 0.05 * index}
        make_folder(folder.run(index), index, metrics=metrics)
    (folder.run(2) / "index.html").write_text("<p>a run</p>")
    assert report([folder.path], root / "page.html") == 0
    return root


def test_the_page_has_the_answer_the_options_and_every_run(made):
    html = (made / "page.html").read_text(encoding="utf-8")
    assert "12 runs: 12 done" in html
    # The mean of 0.9, 0.85, 0.8 and 0.75, each 0.2 above that of the next value and the same seed.
    best = r"Mean IoU: sigma_q=0.1 0.8\d \[0.70.* is the best \(4 seeds\); sigma_q=0.4 is next"
    assert re.search(rf"{best}, −0.2", html)
    rows = re.findall(r"<tr><td.*?</tr>", html, re.DOTALL)
    assert [re.search(r'<td class="">(.*?)</td>', row)[1] for row in rows[:3]] == [*VALUES]
    assert "0.750 (seed=3)" in rows[0] and 'href="widths/runs/0003"' in rows[0]
    data = json.loads(re.search(r'id="data">(.*?)</script>', html)[1])
    assert len(data["rows"]) == 12 and data["links"][2] == "widths/runs/0002/index.html"
    assert data["axes"] == ["tracker.sigma_q", "seed"]
    assert html.count("Over tracker.sigma_q") == 1
    # On a telephone of 390 px, with margins and a scroll bar.
    assert max(map(int, re.findall(r'min-width: (\d+)px"', html))) <= 350
    assert html.count(' over time"') == 6
    assert "stixel sweep tracker.sigma_q=0.1,0.4,1.6" in html
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html)


@pytest.fixture
def folder(made, tmp_path):
    """A copy of the sweep, to change."""
    return shutil.copytree(made / "widths", tmp_path / "widths")


@pytest.mark.sketched
def test_a_seed_that_an_option_lacks_is_left_out(folder, tmp_path):
    shutil.rmtree(folder / "runs/0001")
    assert report([folder], tmp_path / "page.html") == 0
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "12 runs: 11 done and 1 missing" in html
    assert "Left out: seed=1, where sigma_q=0.1 lacks values" in html
    assert "3 of 4 seeds: too few to compare" in html
    # The options that have the seed are shown without it.
    curves = over_time(read_sweep(folder).ask())
    assert {len(errors["iou"]) for _, errors in curves.values()} == {3}
    for index in range(12):
        shutil.rmtree(folder / f"runs/{index:04d}", ignore_errors=True)
    with pytest.raises(UserError, match="no run is done; resume with: stixel sweep --resume"):
        report([folder], tmp_path / "none.html")
    assert not (tmp_path / "none.html").exists()


def test_without_a_common_unit_there_is_no_figure(folder, tmp_path):
    for index in range(4):
        shutil.rmtree(folder / f"runs/{index + 4 * (index % 2):04d}")
    assert report([folder], tmp_path / "page.html") == 0
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "each seed, lacks a value of an option" in html and "the runs in its header" in html
    assert "<h2>Values and differences</h2>" in html and 'aria-label="Values and diff' not in html


def test_runs_of_other_times_are_compared_over_their_share(folder):
    whole = over_time(read_sweep(folder).ask())
    assert set(whole) == set(VALUES) and len(whole["0.1"][0]) < len(SHARES)
    np.savez(folder / "runs/0000/scores.npz", t=np.arange(3.0), iou=np.array([0.0, 0.5, 1.0]))
    shares, errors = over_time(read_sweep(folder).ask())["0.1"]
    np.testing.assert_array_equal(shares, SHARES)
    # Only what all runs have.
    assert set(errors) == {"iou"} and errors["iou"].shape == (4, 101)
    np.testing.assert_allclose(errors["iou"][0], SHARES)


def test_tables_and_figures_are_written_for_a_paper(made, tmp_path, capsys):
    sweep = [made / "widths"]
    assert report(sweep, form="tex", metrics="iou_mean,nis_mean") == 0
    said = capsys.readouterr().out
    # The best IoU of all seeds is shown; of a NIS, no value is the best.
    assert said.startswith("\\begin{tabular}{lrrr}") and said.count("textbf") == 1
    for form, begin in (("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")):
        assert report(sweep, tmp_path / f"a.{form}", form, metrics="nis_mean") == 0
        assert (tmp_path / f"a.{form}").read_bytes().startswith(begin)
    assert "NIS" in capsys.readouterr().out
    assert report(sweep, tmp_path / "b.csv", "csv", reference="0.4", metrics="iou_mean") == 0
    written = pd.read_csv(tmp_path / "b.csv", index_col=0)
    assert written.loc[0.1, "minus"] == pytest.approx(0.2)
    column = ({"metrics": "iou"}, "iou: no such column")
    axis = ({"over": "path"}, "over: path is not swept")
    for options, said in (column, axis, ({"reference": "9"}, "reference: 9: no option")):
        with pytest.raises(UserError, match=said):
            report(sweep, tmp_path / "none.html", **options)


def test_failed_runs_of_a_stored_sweep_count_as_lost(folder, capsys):
    failures = {4: {"status": "failed", "error": "ValueError: no"}, 5: {"status": "skipped"}}
    for index, content in failures.items():
        shutil.rmtree(folder / f"runs/{index:04d}")
        (folder / f"failed/{index:04d}").mkdir(parents=True)
        (folder / f"failed/{index:04d}/failure.json").write_text(json.dumps(content))
    runs = read_sweep(folder).table
    assert list(runs.frame["status"][4:6]) == ["failed", "skipped"]
    assert runs.frame["error"][4] == "ValueError: no"
    answer = runs.ask(metric="iou_mean")
    assert answer.table.loc["0.4", "lost_share"] == 0.5
    assert report([folder], form="md", metrics="iou_mean") == 0
    assert "Failed: sigma_q=0.4 2 of 4 runs; counted as lost" in capsys.readouterr().out


def test_the_runs_can_be_sorted_filtered_grouped_and_plotted(made, open_page):
    opened = open_page(made / "page.html", 1280, 900)
    page = opened.page

    def column(number):
        rows = page.locator("#runs tbody tr:not(.group)")
        return rows.evaluate_all(f"rows => rows.map(row => row.cells[{number}].textContent)")

    assert column(1) == [value for value in VALUES for _ in SEEDS]
    head = page.locator("#runs th").nth(1)
    head.get_by_role("button").click()
    head.get_by_role("button").click()
    assert column(1)[0] == "1.6" and head.get_attribute("aria-sort") == "descending"
    page.locator("#filter").fill("0.4")
    assert set(column(1)) == {"0.4"} and page.locator("#count").inner_text() == "4 of 12"
    assert page.locator("#plot circle").count() == 4
    page.locator("#filter").fill("")
    page.locator("#group").select_option("tracker.sigma_q")
    assert page.locator("#runs tr.group").count() == 3
    page.locator("#metric").select_option("track loss rate")
    assert "Track loss rate" in page.locator(".answer:visible").inner_text()
    assert opened.overflow() == 0
    small = open_page(made / "page.html", 390, 844, dark=True)
    assert small.overflow() == 0
