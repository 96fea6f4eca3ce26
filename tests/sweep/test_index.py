"""`results/index.html`: the page of all runs and sweeps, written by hand and used in a browser."""

import json
import re
from concurrent.futures import ThreadPoolExecutor

import pytest
from result_folders import make_folder

from stixel_cli.engine.cache_folder import file_lock
from stixel_cli.results.result import listed_run
from stixel_cli.sweeps import index
from stixel_cli.sweeps.folder import TABLE, SweepFolder, SweepRequest
from stixel_cli.sweeps.index import update_index


def rows_of(page):
    text = page.read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="runs">(.*?)</script>', text)[1])
    return {row["path"]: row for row in data["rows"]}, data


def make_run(folder, iou, tracker="gp_ekf", created="2026-01-01T00:00:00+00:00"):
    choices = {"road_user": "car", "path": "turn", "measurement": "stixels", "tracker": tracker}
    manifest = {"choices": choices, "overrides": [f"tracker={tracker}"], "created": created}
    metrics = {"iou_mean": iou, "track_lost": 0.0, "scans": 40}
    make_folder(folder, metrics=metrics, manifest=manifest)


def make_sweep(folder):
    runs = (("tracker=gp_ekf", "seed=0"), ("tracker=contour", "seed=0"))
    axes = (("tracker",),)
    SweepFolder(folder).create(SweepRequest("/", None, False, (), axes, runs, {"command": "x"}))
    table = "run,status,iou_mean,track_lost\n0,done,0.5,1.0\n1,done,0.9,0.0\n2,failed,,\n"
    (folder / TABLE).write_text(table)


@pytest.fixture
def root(tmp_path):
    """Two runs, a sweep of a study, a broken folder and a foreign one."""
    make_run(tmp_path / "a", 0.75)
    (tmp_path / "a/index.html").write_text("a page")
    make_run(tmp_path / "b, <i>", 0.25, "contour", "2026-01-02T00:00:00+00:00")
    make_sweep(tmp_path / "rq2/sweeps/main")
    (tmp_path / "rq2/report.html").write_text("a report")
    for name in ("broken", "foreign"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").write_text('{"a":')
    return tmp_path


def test_each_folder_has_a_row(root, monkeypatch):
    def listed(folder):
        # Content that passes all checks, and which nobody has thought of.
        return listed_run(folder) if folder.name != "foreign" else 1 / 0

    monkeypatch.setattr(index, "listed_run", listed)
    update_index(root)
    rows, data = rows_of(root / "index.html")
    assert set(rows) == {"a", "b, <i>", "rq2/sweeps/main", "broken", "foreign"}
    assert rows["a"]["page"] == "./a/index.html"
    assert rows["b, <i>"]["page"] == "./b%2C%20%3Ci%3E/"
    assert rows["a"]["metrics"][1] == [0.75, "0.750"]
    assert rows["a"]["verdict"].startswith("IoU 0.75")
    assert rows["rq2/sweeps/main"]["metrics"][1][0] == pytest.approx(0.7)
    expected = "2 of 3 runs done, IoU 0.50 to 0.90, 1 lost."
    assert rows["rq2/sweeps/main"]["verdict"] == expected
    assert "not valid JSON" in rows["broken"]["fault"]
    assert rows["foreign"]["fault"] == "not a valid result: ZeroDivisionError: division by zero"
    assert data["reports"] == {"rq2": "./rq2/report.html"}


def test_only_new_and_changed_folders_are_read(root, monkeypatch):
    update_index(root)
    read = []
    original = index.listed_run
    monkeypatch.setattr(index, "listed_run", lambda f: read.append(f.name) or original(f))
    (root / "rq2/sweeps/report-main.html").touch()
    update_index(root)
    assert read == []
    assert (
        rows_of(root / "index.html")[0]["rq2/sweeps/main"]["page"]
        == "./rq2/sweeps/report-main.html"
    )
    make_run(root / "c", 0.5)
    (root / "a/metrics.json").write_text('{"iou_mean": 0.125}')
    (root / "broken/manifest.json").unlink()
    update_index(root)
    assert read == ["a", "c"]
    rows, _ = rows_of(root / "index.html")
    assert "broken" not in rows and rows["a"]["metrics"][1][0] == 0.125


def test_pages_of_others_are_kept_and_damaged_ones_are_replaced(root):
    page = root / "index.html"
    page.write_text("my own page")
    update_index(root)
    assert page.read_text() == "my own page"
    page.write_text('<script type="application/json" id="runs">{"version": 1, </script>')
    update_index(root)
    assert "a" in rows_of(page)[0]


def test_several_commands_at_once_lose_no_row(root):
    names = [f"run{number}" for number in range(8)]

    def command(name):
        make_run(root / name, 0.5)
        update_index(root)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(command, names))
    assert {*names} <= {*rows_of(root / "index.html")[0]}


def test_a_page_that_cannot_be_written_fails_no_command(root, monkeypatch):
    monkeypatch.setattr(index, "PATIENCE", 0.0)
    with file_lock(root / ".index.lock"):
        update_index(root)
    assert not (root / "index.html").exists()
    (root / "index.html").mkdir()
    update_index(root)
    assert (root / "index.html").is_dir()


def test_rows_are_sorted_filtered_and_grouped(root, open_page):
    update_index(root)
    opened = open_page(root / "index.html", 1280, 900)
    page = opened.page

    def names():
        return page.locator("td.name").all_inner_texts()

    # The newest first; a study's sweeps are in a group with a link to its report.
    assert names()[:2] == ["b, <i>", "a"]
    assert names()[-1] == "rq2/sweeps/main"
    assert page.get_by_role("link", name="report").get_attribute("href") == "./rq2/report.html"
    page.select_option("#group", label="nothing")
    by_iou = page.locator("thead button").nth(4)
    by_iou.click()
    assert names()[:3] == ["b, <i>", "rq2/sweeps/main", "a"]
    by_iou.click()
    assert names()[:3] == ["a", "rq2/sweeps/main", "b, <i>"]
    page.select_option("#group", label="tracker")
    heads = page.locator("tr.group").all_inner_texts()
    assert [head.split()[0] for head in heads] == ["contour", "gp_ekf", "sweeps"]
    page.fill("#filter", "contour car")
    assert names() == ["b, <i>"]
    assert opened.problems == []
    narrow = open_page(root / "index.html", 390, 844, dark=True)
    assert narrow.overflow() == 0 and narrow.problems == []
