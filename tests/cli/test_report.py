"""`stixel report`."""

import json
from pathlib import Path

import numpy as np
import pytest

from stixel_cli.cli.app import main
from stixel_cli.cli.report import report
from stixel_cli.errors import UserError


@pytest.fixture
def folders(tmp_path):
    made = []
    for i, name in enumerate(("one", "two")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "config.yaml").write_text(f"seed: {i}\n")
        (folder / "manifest.json").write_text("{}")
        (folder / "metrics.json").write_text(json.dumps({"iou_mean": 0.5 + i / 10}))
        np.savez(folder / "scores.npz", t=np.arange(3.0), iou=np.array([0.5, np.nan, 0.7]))
        made.append(folder)
    return made


@pytest.mark.sketched
def test_report_prints_the_page(folders, capsys):
    assert report(folders, None) == 0
    sentence, page = capsys.readouterr().out.strip().rsplit("\n", 1)
    assert sentence.startswith("Mean IoU: two 0.600 and one 0.500")
    page = Path(page)
    assert page == folders[0].parent / "report-one-two.html"
    assert "two 0.600" in page.read_text()
    assert report(folders, None) == 0
    assert capsys.readouterr().out.strip().endswith("report-one-two-2.html")


@pytest.mark.sketched
def test_report_writes_where_it_is_told(folders, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert report(folders, page) == 0
    assert f"--output {page}" in page.read_text()
    assert main(["report", *map(str, folders), "--output", str(page)]) == 2
    assert "not overwritten" in capsys.readouterr().err
    with pytest.raises(UserError, match="cannot be written"):
        report(folders, tmp_path / "nowhere" / "page.html")


def test_report_refuses(folders, tmp_path):
    for given in (folders[:1], [folders[0], folders[0]], [folders[0], tmp_path / "none"]):
        with pytest.raises(UserError) as failure:
            report(given, None)
        assert "\n" not in str(failure.value)
    assert not list(tmp_path.glob("*.html"))


def test_report_of_one_folder_names_its_page_or_its_fault(folders, tmp_path):
    with pytest.raises(UserError, match=f"is one run: .*; its page is {folders[0]}/index.html"):
        report(folders[:1], None)
    with pytest.raises(UserError, match="nowhere: no such folder"):
        report([tmp_path / "nowhere"], None)


def test_a_table_and_a_figure_of_runs(folders, capsys):
    assert report(folders, form="md") == 0
    said = capsys.readouterr().out
    assert "| one | 1 | 0.500 |" in said and "**" not in said
    assert report(folders, form="svg") == 0
    assert (folders[0].parent / "figure-one-two.svg").exists()
    assert main(["report", *map(str, folders), "--format", "doc"]) == 2
    assert "'--format': 'doc' is not one of" in capsys.readouterr().err
    with pytest.raises(UserError, match="--compare: is for one sweep"):
        report(folders, form="md", compare="seed")
