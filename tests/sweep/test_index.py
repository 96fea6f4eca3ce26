"""`results/index.html`: the page of all runs and sweeps, written by hand and used in a browser."""

import json
import re
from concurrent.futures import ThreadPoolExecutor

import pytest
from result_folders import make_folder

from stixel_cli.engine.cache_folder import file_lock
from stixel_cli.results.result import listed_run
from stixel_cli.sweeps import index
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest
from stixel_cli.sweeps.index import update_index


def rows_of(page):
    """The values of each row by the column's title, and its link."""
    text = page.read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="index">(.*?)</script>', text)[1])
    titles = [column["title"] for column in data["columns"]]
    rows = zip(data["names"], data["rows"], data["links"], strict=True)
    return {name: dict(zip(titles, row, strict=True)) | {"link": link} for name, row, link in rows}


def make_run(folder, iou, tracker="gp_ekf", created="2026-01-01T00:00:00+00:00"):
    choices = {"road_user": "car", "path": "turn", "measurement": "stixels", "tracker": tracker}
    manifest = {"choices": choices, "overrides": [f"tracker={tracker}"], "created": created}
    metrics = {"iou_mean": iou, "track_lost": 0.0, "scans": 40}
    make_folder(folder, metrics=metrics, manifest=manifest)


@pytest.fixture
def root(tmp_path):
    """Two runs, a sweep of a study, a broken folder and a foreign one."""
    make_run(tmp_path / "a", 0.75)
    (tmp_path / "a/index.html").write_text("a page")
    make_run(tmp_path / "b, <i>", 0.25, "contour", "2026-01-02T00:00:00+00:00")
    runs = tuple((f"tracker={name}", "seed=0") for name in ("gp_ekf", "contour", "point"))
    request = SweepRequest("/", False, (), (("tracker",),), runs, {"command": "x"})
    SweepFolder(tmp_path / "rq2/sweeps/main").create(request)
    for i, iou in enumerate((0.5, 0.9)):
        folder = tmp_path / f"rq2/sweeps/main/runs/{i:04d}"
        make_folder(folder, metrics={"iou_mean": iou, "track_lost": 1 - i})
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
    rows = rows_of(root / "index.html")
    assert set(rows) == {"a", "b, <i>", "rq2/sweeps/main", "broken", "foreign", "rq2"}
    assert rows["a"]["link"] == "./a/index.html"
    assert rows["b, <i>"]["link"] == "./b%2C%20%3Ci%3E/"
    assert rows["a"]["mean IoU"] == 0.75 and rows["a"]["verdict"].startswith("IoU 0.75")
    assert rows["rq2/sweeps/main"]["mean IoU"] is None, "a mean over trackers is none of any"
    said = "2 of 3 runs done. Mean IoU: contour 0.900 and gp_ekf 0.500 (one run each: too few to "
    said += "compare, 4 are needed). Not compared: point, without a value."
    assert rows["rq2/sweeps/main"]["verdict"] == said
    assert "not valid JSON" in rows["broken"]["verdict"]
    assert rows["foreign"]["verdict"] == "not a valid result: ZeroDivisionError: division by zero"
    assert rows["rq2"]["link"] == "./rq2/report.html"


def test_only_new_and_changed_folders_are_read(root, monkeypatch):
    update_index(root)
    read = []
    original = index.listed_run
    monkeypatch.setattr(index, "listed_run", lambda f: read.append(f.name) or original(f))
    update_index(root)
    assert read == []
    make_run(root / "c", 0.5)
    (root / "a/metrics.json").write_text('{"iou_mean": 0.125}')
    (root / "broken/manifest.json").unlink()
    update_index(root)
    assert read == ["a", "c"]
    rows = rows_of(root / "index.html")
    assert "broken" not in rows and rows["a"]["mean IoU"] == 0.125


def test_pages_of_others_are_kept_and_damaged_ones_are_replaced(root):
    page = root / "index.html"
    page.write_text("my own page")
    update_index(root)
    assert page.read_text() == "my own page"
    page.write_text('<script type="application/json" id="runs">{"version": 1, </script>')
    update_index(root)
    assert "a" in rows_of(page)


def test_several_commands_at_once_lose_no_row(root):
    names = [f"run{number}" for number in range(8)]

    def command(name):
        make_run(root / name, 0.5)
        update_index(root)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(command, names))
    assert {*names} <= {*rows_of(root / "index.html")}


def test_a_page_that_cannot_be_written_fails_no_command(root, monkeypatch):
    monkeypatch.setattr(index, "PATIENCE", 0.0)
    with file_lock(root / ".index.lock"):
        update_index(root)
    assert not (root / "index.html").exists()
    (root / "index.html").mkdir()
    update_index(root)
    assert (root / "index.html").is_dir()


def test_the_newest_is_first_and_the_page_fits_a_phone(root, open_page):
    update_index(root)
    narrow = open_page(root / "index.html", 390, 844, dark=True)
    rows = narrow.page.locator("#runs tbody tr:not(.group)")
    names = rows.evaluate_all("rows => rows.map(row => row.cells[0].textContent)")
    assert names[:3] == ["rq2/sweeps/main", "b, <i>", "a"] and names[-1] == "rq2"
    link = narrow.page.get_by_role("link", name="rq2", exact=True)
    assert link.get_attribute("href") == "./rq2/report.html"
    assert narrow.overflow() == 0
