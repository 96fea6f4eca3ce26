import numpy as np
import pytest

from stixel_cli.benchmark.data import sha256
from stixel_cli.benchmark.page import bench_page, score_frame, table_rows
from stixel_cli.benchmark.score import METRIC_VERSION, write_row
from stixel_cli.benchmark.sequences import whole_set
from stixel_cli.cli.app import main

NAMES = [one.name for one in whole_set(mini=True)]
NOISE = np.random.default_rng(0)


def row(name, ious, tier="rerun", pack="", **about):
    tracker = {"name": name, "version": "1", "causal": True, "per_class": False, "start": "given"}
    tracker |= {"settings": {}, "code": "", "licence": "", "learnt_from": ""}
    scores = {"iou_mean": np.clip(ious, 0.0, 1.0).tolist(), "ms_per_scan": [1.0] * len(ious)}
    # The only track that was lost.
    lost = [2.0 if name == "gp_ekf" else None, *[None] * (len(ious) - 1)]
    scores["time_to_loss_s"] = lost
    return {
        "tracker": tracker | about,
        "benchmark": "a" * 64,
        "tier": tier,
        "metric_version": METRIC_VERSION,
        "sequences": NAMES,
        "pack": pack or sha256(name.encode()),
        "scores": scores,
    }


def rows():
    base = NOISE.uniform(0.5, 0.7, len(NAMES))
    jitter = NOISE.normal(0.0, 0.05, len(NAMES))
    return [
        row("gp_ekf", base),
        row("equal", base + jitter - jitter.mean()),
        row("better", base + 0.1),
        row("smoothed", base + 0.2, causal=False),
    ]


def test_a_better_tracker_has_rank_1_and_equal_ones_share_their_ranks():
    given = rows()
    lines = [one for one in table_rows(given, score_frame(given)) if one["class"] == "all classes"]
    lines = [line for line in lines if line["sensor"] == "all sensors"]
    by_name = {line["tracker"]: line for line in lines}
    assert [line["tracker"] for line in lines][:2] == ["smoothed", "better"]
    assert by_name["smoothed"]["kind"] == "not causal" and by_name["smoothed"]["rank"] is None
    better, equal, reference = (by_name[name] for name in ("better", "equal", "gp_ekf"))
    assert (better["rank"], better["low rank"], better["high rank"]) == (1, 1, 1)
    assert (equal["low rank"], equal["high rank"]) == (2, 3)
    assert (reference["low rank"], reference["high rank"]) == (2, 3)
    # Paired: the scenes' own difference drops out.
    np.testing.assert_allclose(better["IoU minus gp_ekf"], 0.1, atol=1e-9)
    assert better["high IoU minus gp_ekf"] - better["low IoU minus gp_ekf"] < 1e-9
    assert equal["low IoU minus gp_ekf"] < 0.0 < equal["high IoU minus gp_ekf"]
    assert (reference["time to loss (s)"], equal["time to loss (s)"]) == (2.0, None)
    assert better["scenes"] == 24 and better["ms a scan"] == 1.0


def test_the_page_has_a_line_for_each_sensor_and_class_and_the_gap_to_fresh_seeds():
    fresh = row("better", np.full(len(NAMES), 0.5), "fresh", "c" * 64) | {
        "fresh_of": sha256(b"better")
    }
    files = bench_page([*rows(), fresh | {"benchmark": "b" * 64}])
    assert {*files} == {"index.html", f"{'a' * 12}.csv", f"{'a' * 12}.md"}
    assert len(files[f"{'a' * 12}.csv"].splitlines()) == 1 + 4 * 16
    assert "1 [1, 1]" in files[f"{'a' * 12}.md"]
    page = files["index.html"]
    assert "frozen - fresh" in page and page.count("<details>") == 4


def test_rows_of_another_processor_share_the_table_and_have_their_own_reference():
    here = rows()[:2]
    there = [one | {"benchmark": "b" * 64} for one in rows()[:2]]
    lines = [one for one in table_rows([*here, *there], score_frame([*here, *there]))][:4]
    assert {line["data"] for line in lines} == {"a" * 8, "b" * 8}
    apart = {(one["tracker"], one["data"]): one["IoU minus gp_ekf"] for one in lines}
    assert apart["gp_ekf", "a" * 8] == apart["gp_ekf", "b" * 8] == 0.0
    assert {*bench_page([*here, *there])} == {"index.html", f"{'a' * 12}.csv", f"{'a' * 12}.md"}


@pytest.mark.parametrize("key", ["benchmark", "pack", "fresh_of", "sequences"])
@pytest.mark.parametrize("place", ["../evil", "{folder}/evil"])
def test_a_row_that_names_a_file_elsewhere_is_refused(key, place, tmp_path, monkeypatch, capsys):
    name = place.format(folder=tmp_path)
    edited = row("gp_ekf", np.full(len(NAMES), 0.5))
    edited[key] = [name, *NAMES[1:]] if key == "sequences" else name
    folder = tmp_path / "work"
    write_row(edited, folder / "rows")
    monkeypatch.chdir(folder)
    assert main(["bench", "page", "--rows", "rows", "--output", "site"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert key in line or "not the name of a sequence" in line
    assert not (folder / "site").exists() and not list(tmp_path.rglob("evil*"))


def test_bench_page_reads_the_rows_of_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_row(rows()[0], tmp_path / "rows")
    assert main(["bench", "page", "--rows", "rows", "--output", "site"]) == 0
    assert "gp_ekf" in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
