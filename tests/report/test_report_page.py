"""Result folders read back, and the page that puts them side by side."""

import copy
import json
import re

import numpy as np
import pytest
from result_folders import CONFIG, make_folder

from stixel_cli.border import write_new
from stixel_cli.errors import UserError
from stixel_cli.evaluation.metric_table import METRICS, metric
from stixel_cli.evaluation.verdict import verdict
from stixel_cli.pictures import style
from stixel_cli.report.compare import (
    default_page,
    line_style,
    page_html,
    run_labels,
)
from stixel_cli.report.metrics import (
    MAIN,
    best,
    format_value,
    main_metrics,
    score_table,
    shown_difference,
)
from stixel_cli.report.playback_values import summary_of
from stixel_cli.results.result import read_scored_run


@pytest.fixture
def folders(tmp_path):
    other = copy.deepcopy(CONFIG)
    other["measurement"] = {"kind": "fabricated", "rays": 640}
    return [
        make_folder(tmp_path / "first", 1),
        make_folder(tmp_path / "second", 2, other, metrics={"extra_m": 1.5}),
    ]


def make_page(folders):
    runs = [read_scored_run(folder) for folder in folders]
    return page_html(runs, ["stixel", "report", "a b"], folders[0].parent / "page.html")


def test_page_shows_differing_settings(folders):
    page = make_page(folders)
    differing = page[page.index("Settings that differ") : page.index("settings are the same")]
    assert re.findall(r'class="key" role="rowheader">([^<]+)<', differing) == [
        "measurement ",
        "measurement.least_height",
        "measurement.rays",
    ]
    # The exchanged group is one row, which unfolds.
    assert differing.count("<details>") == 2 and "(2 settings)" in differing
    assert '<span role="cell">stixels</span><span role="cell">fabricated</span>' in differing
    assert "centre error, RMSE" in page
    assert page.count('<td class="best">') == 2
    assert "NIS / degrees of freedom, mean" not in page  # null in both
    assert page.count("older version") == 2  # track loss is not in their metrics
    assert "0123456789ab with uncommitted changes" in page
    assert "stixel report &#39;a b&#39;" in page


def test_the_verdicts_and_metrics_come_before_the_settings(folders):
    page = make_page(folders)
    assert 'class="verdicts"' in page.partition("<h2>")[0]
    titles = re.findall("<h2>([^<]+)</h2>", page)
    assert titles == [
        *("Metrics", "Errors over time", "Paths and shapes"),
        *("Settings that differ", "Provenance"),
    ]


def test_metrics_have_the_difference_of_two_runs(tmp_path):
    made = [
        make_folder(tmp_path / name, 1, metrics={"centre_rmse_m": value})
        for name, value in (("a", 0.5), ("b", 0.375), ("c", None))
    ]
    assert "<td>−0.125</td>" in make_page(made[:2])
    assert "<td>+0.125</td>" in make_page(made[1::-1])
    assert "+0" not in make_page(made[:2]).partition("Errors over time")[0]
    three = make_page(made)
    assert "<small>−0.125</small>" in three and "<small>–</small>" in three


def test_a_page_warns_of_other_durations_scenes_and_seeds(tmp_path):
    first = make_folder(tmp_path / "first", 1)
    assert 'class="warning"' not in make_page([first, make_folder(tmp_path / "same", 2)])
    other = copy.deepcopy(CONFIG) | {"seed": 3}
    other["path"] = {"kind": "approach", "speed": 2.0}
    short = {name: np.ones(10) for name in ("iou", "iou_box", "centre_error", "nis")}
    short |= {"t": 0.1 * np.arange(10), "k": None}
    short |= dict.fromkeys(("orientation_error", "nees_position"))
    page = make_page([first, make_folder(tmp_path / "other", 2, other, series=short)])
    found = re.findall('class="warning">([^<]+)<', page)
    assert [text.partition(" (")[0].partition(":")[0] for text in found] == [
        "The durations differ",
        "The scenes differ",
        "The seeds differ",
    ]
    assert "(3.9 s, 0.9 s)" in found[0] and "(path)" in found[1]
    # Metrics of other scans have neither a best value nor a headline.
    assert 'class="best"' not in page and 'class="headline"' not in page


def test_the_page_begins_with_the_differences_and_folds_most_metrics(tmp_path):
    first = {"iou_mean": 0.5, "centre_rmse_m": 1.0, "hausdorff_m": 2.0}
    made = [make_folder(tmp_path / "first", 1, metrics=first)]
    expected = {
        (0.6, 0.21): "IoU +0.100, centre error a fifth",
        (0.4, 0.5): "IoU −0.100, centre error half",
        (0.5, 0.9): "IoU 0.000, centre error −10 %",
        (0.5, 2.5): "IoU 0.000, centre error 2.5 times",
        (0.5, 0.01): "IoU 0.000, centre error 0.01 times",
        (0.5, None): "IoU 0.000",
    }
    for number, (iou, centre) in enumerate(expected):
        metrics = {"iou_mean": iou, "centre_rmse_m": centre}
        made.append(make_folder(tmp_path / f"r{number}", 1, metrics=metrics))
    page = make_page(made)
    found = re.findall('class="headline">([^<]+)<', page)
    assert found == [
        f"r{number}, compared with first: {text}." for number, text in enumerate(expected.values())
    ]
    shown, _, folded = page.partition("other metrics</summary>")
    assert "centre error, RMSE" in shown and "Hausdorff" not in shown and "Hausdorff" in folded


def test_a_page_links_to_the_pages_of_its_runs(folders):
    (folders[1] / "index.html").write_text("")
    page = make_page(folders)
    assert re.findall('<a href="([^"]+)"', page) == ["second/index.html"]


def test_equivalent_settings_do_not_differ(tmp_path):
    folders = [
        make_folder(tmp_path / name, 1, CONFIG | {"path": {"duration": duration}})
        for name, duration in (("a", 3), ("b", 3.0))
    ]
    assert "All settings are the same." in make_page(folders)


def test_page_shows_options_of_groups_without_kind(folders):
    for folder, rig in zip(folders, ("default", "kitti"), strict=True):
        file = folder / "manifest.json"
        choices = {"rig": rig, "measurement": "any"}
        file.write_text(json.dumps(json.loads(file.read_text()) | {"choices": choices}))
    page = make_page(folders)
    cells = '<span role="cell">default</span><span role="cell">kitti</span>'
    assert f'class="key" role="rowheader">rig</span>{cells}' in page
    assert 'role="rowheader">measurement.any' not in page


def test_runs_have_different_line_styles():
    looks = {(style.RUNS[i % len(style.RUNS)], line_style(i)) for i in range(32)}
    assert len(looks) == 32


def test_page_is_self_contained(folders):
    page = make_page(folders)
    assert "http:" not in page
    assert "https:" not in page
    assert "<script" not in page
    assert "<link" not in page
    assert page.count("data:image/png;base64,") == 2
    # A picture 80 px wide, with letters of 12.2 px, is shown at least 66 px wide.
    assert page.count('style="min-width: 66px"') == 2
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    for used in re.findall(r'(?:url\(|href=")#([^")]+)', page):
        assert used in names


def test_page_has_repeatable_bytes(folders):
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


def test_page_accepts_runs_without_series_or_picture(tmp_path):
    empty = dict.fromkeys(("centre_error", "orientation_error", "iou_box", "nees_position"))
    lost = {"iou": np.full(40, np.nan), "nis": np.full(40, np.nan)}
    folders = [make_folder(tmp_path / name, 1, series=empty | lost) for name in ("a", "b")]
    (folders[0] / "figures" / "path.png").unlink()
    page = make_page(folders)
    assert "The runs have no errors over time" in page
    assert "<svg viewBox" not in page.partition("<h2>Errors over time")[2].partition("<h2>Paths")[0]
    assert "This run has no picture of its path" in page


def test_labels_distinguish_folders_of_one_name(tmp_path):
    folders = [tmp_path / "x" / "run", tmp_path / "y" / "run"]
    assert run_labels(folders) == ["x/run", "y/run"]
    with pytest.raises(UserError, match="same folder"):
        run_labels([folders[0], folders[0]])


def test_default_page_is_an_unused_file(folders):
    page = default_page(folders)
    assert page == folders[0].parent / "report-first-second.html"
    write_new(page, "x")
    assert default_page(folders).name == "report-first-second-2.html"
    with pytest.raises(UserError, match="already exists"):
        write_new(page, "y")
    assert page.read_text() == "x"
    many = [folders[0].parent / f"{'long' * 12}-{i}" for i in range(6)]
    assert default_page(many).name == f"report-{'long' * 12}-0-and-5-more.html"


@pytest.mark.parametrize(
    ("file", "content", "told"),
    [
        ("manifest.json", None, "not the result folder"),
        ("manifest.json", "{", "not valid JSON"),
        ("manifest.json", "[" * 100_000, "not valid JSON"),
        ("manifest.json", "[1]", "must map names"),
        ("config.yaml", None, "config.yaml is missing"),
        ("config.yaml", "a: [", "not valid YAML"),
        ("config.yaml", "!!python/object/apply:os.getcwd []", "not valid YAML"),
        ("config.yaml", "a: &a {b: *a}", "an alias of itself"),
        ("config.yaml", "just text", "must contain the groups"),
        ("config.yaml", b"\xff\xfe\x00", "not a text"),
        ("metrics.json", '{"iou_mean": "high"}', "iou_mean must be a number"),
        ("metrics.json", '{"iou_mean": NaN}', "iou_mean: not a finite number"),
        ("scores.npz", None, "scores.npz is missing"),
        ("scores.npz", b"nothing", "not a file of numeric arrays"),
        ("figures/path.png", b"GIF89a", "not a PNG image"),
    ],
)
def test_bad_folders_give_one_line_errors(folders, file, content, told):
    path = folders[0] / file
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(UserError, match=told) as failure:
        read_scored_run(folders[0])
    assert "\n" not in str(failure.value)


def test_arrays_are_not_unpickled(folders):
    np.savez(folders[0] / "scores.npz", t=np.array([{}], dtype=object))
    with pytest.raises(UserError, match="not a file of numeric arrays"):
        read_scored_run(folders[0])


def test_arrays_of_wrong_shape_are_rejected(folders):
    np.savez(folders[0] / "scores.npz", t=np.arange(3.0), iou=np.arange(4.0))
    with pytest.raises(UserError, match="iou has shape"):
        read_scored_run(folders[0])


def test_missing_folder_is_rejected(tmp_path):
    with pytest.raises(UserError, match="no such folder"):
        read_scored_run(tmp_path / "nothing")
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="not a folder"):
        read_scored_run(tmp_path / "file")


def test_best_follows_the_direction_of_the_metric():
    assert best("centre_rmse_m", [0.2, 0.1, None]) == [False, True, False]
    assert best("iou_mean", [0.2, 0.9, 0.9]) == [False, True, True]
    assert best("nis_mean", [0.5, 1.5, 30.0]) == [False, True, False]
    assert best("nis_mean", [0.0, 1.5]) == [False, True]
    # Far from 1 no value is good.
    assert best("nis_mean", [0.05, 0.3]) == best("nees_position_mean", [2.4, 9.0]) == [False, False]
    assert best("scans", [1, 2]) == [False, False]
    assert best("iou_mean", [0.5, 0.5]) == [False, False]
    assert best("iou_mean", [None, 0.5]) == [False, False]


def test_values_that_are_shown_alike_are_equally_good():
    assert best("iou_mean", [0.81004, 0.81001]) == [False, False]
    assert best("iou_mean", [0.81004, 0.81001, 0.7]) == [True, True, False]


def test_a_difference_has_the_decimals_of_its_values():
    assert shown_difference("iou_mean", 0.81001, 0.81004) == "0.000"
    assert shown_difference("iou_mean", 0.70, 0.81) == "\u22120.110"
    assert shown_difference("centre_rmse_m", 0.1988, 0.1984) == "+0.0004"
    assert shown_difference("success", 0.835, 0.83) == "+0.5"
    assert shown_difference("scans", 12, 10) == "+2"
    assert shown_difference("centre_rmse_m", 12345.0, 12.0) == "+1.23e+04"
    assert shown_difference("centre_rmse_m", None, 12.0) == "–"


def test_format_value_keeps_significant_digits():
    assert format_value(None) == "–"
    assert format_value(float("nan")) == "–"
    assert format_value(100) == "100"
    assert format_value(0.0) == "0.000"
    assert format_value(0.12345) == "0.123"
    assert format_value(12.345) == "12.35"
    assert format_value(123456.0) == "1.23e+05"
    assert metric("new_thing_m").label == "new thing"
    assert metric("new_thing_m").unit == "m"


def test_the_main_metrics_are_of_the_table_and_in_order():
    assert set(MAIN) <= METRICS.keys() and len(MAIN) == 6
    metrics = {"nis_mean": 1.0, "my_lag_m": 2.0, "hausdorff_m": 0.2, "iou_mean": 0.8}
    assert list(main_metrics(metrics)) == ["iou_mean", "nis_mean", "my_lag_m"], "and one's own"


def test_the_rows_of_scores_are_name_value_and_unit():
    columns, rows, right = score_table(
        {"centre_rmse_m": 0.1234, "nis_mean": None, "success": 0.4556}
    )
    assert columns == ("score", "value", "unit") and right == (1,)
    assert [row[1:] for row in rows] == [("0.123", "m"), ("45.6", "%")]


def test_smoothed_scores_are_beside_those_of_the_filter_and_named_so():
    metrics = {"iou_mean": 0.7, "nis_mean": 1.0, "smoothed_iou_mean": 0.8, "smoothed_lag": 5}
    columns, rows, right = score_table(metrics)
    assert columns == ("score", "filtered", "smoothed, lag 5", "unit") and right == (1, 2)
    assert [row[1:] for row in rows] == [("0.700", "0.800", ""), ("1.000", "", "")]
    assert list(main_metrics({**metrics, "smoothed_width_error_m": 0.1, "my_lag_m": 2.0})) == [
        *("iou_mean", "nis_mean", "my_lag_m", "smoothed_lag", "smoothed_iou_mean")
    ]
    assert summary_of(metrics)[0] == ["mean IoU", "0.700 (smoothed, lag 5: 0.800)"]
    assert verdict(metrics) == verdict({"iou_mean": 0.7, "nis_mean": 1.0})
