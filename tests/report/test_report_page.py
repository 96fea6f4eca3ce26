"""Result folders read back, asked as the runs of one comparison; the page of `stixel assess`."""

import copy
import io
import json
import re

import numpy as np
import pytest
from made_stixels import made_stixels
from PIL import Image
from result_folders import CONFIG, make_folder

from stixel_cli.answers.figures import line_look
from stixel_cli.border.origins import write_new
from stixel_cli.errors import UserError
from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.pictures import style
from stixel_cli.report.assess import LABELS, PICTURES, Assessment, error_map, page_html, sentences
from stixel_cli.report.metrics import MAIN, main_metrics, score_table
from stixel_cli.report.playback import summary_of
from stixel_cli.results.folder import default_page, run_labels
from stixel_cli.results.result import read_scored_run
from stixel_cli.sweeps.folder import asked_folders, sweep_page
from stixel_cli.validation.pair_errors import AreaErrors


@pytest.fixture
def folders(tmp_path):
    other = copy.deepcopy(CONFIG)
    other["measurement"] = {"kind": "fabricated", "rays": 640}
    return [
        make_folder(tmp_path / "first", 1),
        make_folder(tmp_path / "second", 2, other, metrics={"extra_m": 1.5}),
    ]


def make_page(folders):
    command = ["stixel", "report", "a b"]
    return sweep_page(asked_folders(folders), folders[0].parent / "page.html", command)


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page)[1])


def test_runs_are_rows_with_the_settings_and_options_that_differ(folders):
    asked = asked_folders(folders)
    frame = asked.runs.frame
    # The exchanged group is one column.
    assert list(frame.columns[:4]) == ["run", "measurement", "status", "folder"]
    assert frame.loc["second", "measurement"] == "fabricated"
    assert np.isnan(frame.loc["first", "extra_m"]) and frame.loc["second", "extra_m"] == 1.5
    data = data_of(make_page(folders))
    assert data["names"] == ["first", "second"]
    assert [column["title"] for column in data["columns"][:2]] == ["measurement", "status"]
    for folder, rig in zip(folders, ("default", "kitti"), strict=True):
        file = folder / "manifest.json"
        choices = {"rig": rig, "measurement": "any"}
        file.write_text(json.dumps(json.loads(file.read_text()) | {"choices": choices}))
    frame = asked_folders(folders).runs.frame
    assert list(frame["rig"]) == ["default", "kitti"]
    assert list(frame["measurement"]) == ["stixels", "fabricated"]


def test_nothing_is_claimed_of_single_runs(tmp_path):
    made = [
        make_folder(tmp_path / name, 1, metrics={"iou_mean": iou, "centre_rmse_m": centre})
        for name, iou, centre in (("a", 0.5, 0.5), ("b", 0.75, 0.375), ("c", 0.6, None))
    ]
    asked = asked_folders(made)
    assert asked.answers[0].sentence == (
        "Mean IoU: b 0.750, c 0.600 and a 0.500 (one run each: too few to compare, 4 are needed)."
    )
    page = make_page(made)
    assert 'best"' not in page and "Each value is that of one run." in page
    (centre,) = asked_folders(made, "centre_rmse_m", reference="a").answers
    # c has no value, and lacks in no other's difference.
    assert centre.table.loc["b", "minus"] == -0.125


def test_the_page_says_the_verdicts_and_what_is_not_comparable(folders):
    asked = asked_folders(folders)
    assert [text.partition(":")[0] for text in asked.remarks] == ["first", "second"]
    # Track loss is not in their metrics.
    assert make_page(folders).count("older version") == 2
    first = make_folder(folders[0].parent / "whole", 1)
    other = copy.deepcopy(CONFIG) | {"seed": 3}
    other["path"] = {"kind": "approach", "speed": 2.0}
    short = {name: np.ones(10) for name in ("iou", "iou_box", "centre_error", "nis")}
    short |= {"t": 0.1 * np.arange(10), "k": None}
    short |= dict.fromkeys(("orientation_error", "nees_position"))
    made = [first, make_folder(first.parent / "other", 2, other, series=short)]
    found = asked_folders(made).remarks
    assert [text.partition(" (")[0].partition(":")[0] for text in found[:3]] == [
        "The durations differ",
        "The scenes differ",
        "The seeds differ",
    ]
    assert "(3.9 s, 0.9 s)" in found[0] and "(path)" in found[1]


def test_a_page_links_to_the_pages_of_its_runs_and_is_an_unused_file(folders):
    (folders[1] / "index.html").write_text("")
    assert data_of(make_page(folders))["links"] == ["first", "second/index.html"]
    page = default_page(folders)
    assert page == folders[0].parent / "report-first-second.html"
    write_new(page, "x")
    assert default_page(folders).name == "report-first-second-2.html"
    with pytest.raises(UserError, match="already exists"):
        write_new(page, "y")
    assert page.read_text() == "x"
    many = [folders[0].parent / f"{'long' * 12}-{i}" for i in range(6)]
    assert default_page(many).name == f"report-{'long' * 12}-0-and-5-more.html"


def test_equivalent_settings_do_not_differ(tmp_path):
    folders = [
        make_folder(tmp_path / name, 1, CONFIG | {"path": {"duration": duration}})
        for name, duration in (("a", 3), ("b", 3.0))
    ]
    assert asked_folders(folders).runs.axes == ("run",)


def test_runs_have_different_line_styles_and_labels(tmp_path):
    looks = {(look["color"], look["linestyle"]) for look in map(line_look, range(32))}
    assert len(looks) == 32
    folders = [tmp_path / "x" / "run", tmp_path / "y" / "run"]
    assert run_labels(folders) == ["x/run", "y/run"]
    with pytest.raises(UserError, match="same folder"):
        run_labels([folders[0], folders[0]])


def test_page_is_self_contained_and_repeats_to_the_byte(folders):
    page = make_page(folders)
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", page) and "<link" not in page
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    for used in re.findall(r'(?:url\(|href=")#([^")]+)', page):
        assert used in names
    assert make_page(folders) == make_page(folders)


def test_page_escapes_text(tmp_path):
    nasty = "<script>alert(1)</script>"
    config = CONFIG | {"note": nasty, nasty: 1}
    folders = [
        make_folder(tmp_path / "a&b <i>", 1, config, metrics={nasty: 1.0}),
        make_folder(tmp_path / "plain", 2),
    ]
    page = make_page(folders)
    assert nasty not in page
    assert "<i>" not in page
    assert "a&amp;b &lt;i&gt;" in page


def test_a_page_of_runs_without_errors_over_time(tmp_path):
    empty = dict.fromkeys(("centre_error", "orientation_error", "iou_box", "nees_position"))
    lost = {"iou": np.full(40, np.nan), "nis": np.full(40, np.nan)}
    folders = [make_folder(tmp_path / name, 1, series=empty | lost) for name in ("a", "b")]
    assert "Errors over time" not in make_page(folders)


def test_missing_folders_and_arrays_of_wrong_shape_are_rejected(tmp_path, folders):
    with pytest.raises(UserError, match="no such folder"):
        read_scored_run(tmp_path / "nothing")
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="not a folder"):
        read_scored_run(tmp_path / "file")
    np.savez(folders[0] / "scores.npz", t=np.arange(3.0), iou=np.arange(4.0))
    with pytest.raises(UserError, match="iou has shape"):
        read_scored_run(folders[0])


def test_main_metrics_and_rows_of_scores_smoothed_ones_beside_those_of_the_filter():
    assert set(MAIN) <= METRICS.keys() and len(MAIN) == 6
    metrics = {"nis_mean": 1.0, "my_lag_m": 2.0, "hausdorff_m": 0.2, "iou_mean": 0.8}
    assert list(main_metrics(metrics)) == ["iou_mean", "nis_mean", "my_lag_m"], "and one's own"
    columns, rows, right = score_table({"centre_rmse_m": 0.123, "nis_mean": None, "success": 0.456})
    assert columns == ("score", "value", "unit") and right == (1,)
    assert [row[1:] for row in rows] == [("0.123", "m"), ("45.6", "%")]
    metrics = {"iou_mean": 0.7, "nis_mean": 1.0, "smoothed_iou_mean": 0.8, "smoothed_lag": 5}
    columns, rows, right = score_table(metrics)
    assert columns == ("score", "filtered", "smoothed, lag 5", "unit") and right == (1, 2)
    assert [row[1:] for row in rows] == [("0.700", "0.800", ""), ("1.00", "", "")]
    assert list(main_metrics({**metrics, "smoothed_width_error_m": 0.1, "my_lag_m": 2.0})) == [
        *("iou_mean", "nis_mean", "my_lag_m", "smoothed_lag", "smoothed_iou_mean")
    ]
    assert summary_of(metrics)[0] == ["mean IoU", "0.700 (smoothed, lag 5: 0.800)"]
    assert verdict(metrics) == verdict({"iou_mean": 0.7, "nis_mean": 1.0})


def found(**values):
    with style.drawing():
        png = style.png(style.new_figure(4.0, 1.0))
    known = {"stixel_share": 0.8, "free_share": 0.1, "unknown_share": 0.1}
    return Assessment(
        dict.fromkeys(LABELS) | known | values, dict.fromkeys(dict(PICTURES), png), {"match": 0.1}
    )


def test_an_assessment_begins_with_what_it_has_measured():
    assert sentences(found(near_columns=0, near_called_free=0))[0].startswith("No true obstacle")
    assert sentences(found(near_columns=5, near_called_free=0))[0].startswith("0 of 5 columns")
    known = {"median_px": 0.69, "beyond_1px_share": 0.408, "stixels_compared": 355}
    square = {"square_median_px": 0.15, "square_beyond_1px_share": 0.046, "square_compared": 65}
    first = sentences(found(**known, **square, obstacle_covered_share=0.9))[0]
    assert first.startswith("Of 355 stixels with a true disparity, 40.8 % are off by more")
    assert "On square surfaces these are 4.6 % and 0.15 px (65 stixels)." in first
    assert "square" not in sentences(found(**known, square_compared=0))[0]


def test_the_error_map_colours_a_stixel_by_its_error():
    stixels = made_stixels(left=[2, 12], right=[8, 18], top=[2, 2], base=[12, 12])
    errors = AreaErrors(np.array([1]), np.array([2.5]), np.zeros(1), np.array([10.0]))
    image = np.full((16, 24), 100, dtype=np.uint8)
    png = error_map(image, stixels, errors)
    red, green, _ = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int).reshape(-1, 3).T
    # The stixel that is 2.5 px too near is red, far beyond the end of the colour bar.
    assert np.mean((red > 150) & (green < 80)) > 0.05
    none = AreaErrors(np.zeros(0, int), *np.zeros((3, 0)))
    png = error_map(image, stixels, none)
    red, green, _ = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int).reshape(-1, 3).T
    assert np.mean((red > 150) & (green < 80)) < 0.02


def test_pictures_are_not_shown_smaller_than_their_text_is_legible():
    html = page_html(found(), "stixel assess")
    # 440 px wide, with letters of 8 points at 110 dpi.
    assert html.count('style="min-width: 360px"') == len(PICTURES)
