import io
import shutil

import numpy as np
import pandas as pd
import pytest

from stixel_cli.benchmark import sequences
from stixel_cli.benchmark.packs import METRIC_VERSION, write_row
from stixel_cli.benchmark.page import bench_pages, kind_of
from stixel_cli.benchmark.sequences import bench_folder, named, sha256, whole_set
from stixel_cli.cli.app import main

NAMES = [one.name for one in whole_set(mini=True)]
NOISE = np.random.default_rng(0)


def row(name, ious, tier="rerun", names=NAMES, **about):
    tracker = {"name": name, "version": "1", "causal": True, "per_class": False, "start": "given"}
    tracker |= {"settings": {}, "code": "", "licence": "", "learnt_from": ""}
    scores = {"iou_mean": np.clip(ious, 0.0, 1.0).tolist(), "ms_per_scan": [1.0] * len(ious)}
    # The only track that was lost.
    lost = [2.0 if name == "gp_ekf" else None, *[None] * (len(ious) - 1)]
    found = {"tracker": tracker | about, "scores": scores | {"time_to_loss_s": lost}}
    found |= {"benchmark": "a" * 64, "tier": tier, "metric_version": METRIC_VERSION}
    return found | {"sequences": names, "pack": sha256(name.encode())}


def rows():
    base = NOISE.uniform(0.5, 0.7, len(NAMES))
    jitter = NOISE.normal(0.0, 0.05, len(NAMES))
    equal = row("equal", base + jitter - jitter.mean())
    better, smoothed = row("better", base + 0.1), row("smoothed", base + 0.2, causal=False)
    return [row("gp_ekf", base), equal, better, smoothed]


def test_the_page_compares_what_is_comparable():
    given = rows()
    assert [kind_of(one) for one in given] == ["ranked"] * 3 + ["not causal"]
    files = bench_pages(given)
    assert {*files} == {"index.html", *(f"{'a' * 12}.{kind}" for kind in ("html", "csv", "md"))}
    table = pd.read_csv(io.StringIO(files[f"{'a' * 12}.csv"]))
    iou = table[table["metric"] == "iou_mean"].set_index("tracker")
    # Units are seeds, of which the mini set has few; sensors, classes and cases are scenarios.
    seeds = {named(name).seed for name in NAMES}
    assert set(iou["units"]) == {len(seeds)} and set(iou["runs"]) == {len(NAMES)}
    assert [*iou.index] == ["gp_ekf", "equal", "better"]
    assert iou["minus"]["gp_ekf"] == pytest.approx(-0.1)
    assert iou["minus_low"].notna()["equal"] == (len(seeds) >= 4)
    text = files[f"{'a' * 12}.md"]
    # Two scenes do not show a rank.
    assert ("is the best" in text) == (len(seeds) >= 4)
    assert ("too few to compare, 4 are needed" in text) == (len(seeds) < 4)
    page = files[f"{'a' * 12}.html"]
    assert "mini: seeds 0 and 1 of frozen" in page and "the link opens" not in page
    assert "Not compared, in “All runs” only: smoothed (not causal)." in page
    # A time has no better one: the least comes first.
    assert "Ms per scan: gp_ekf 1.00, equal 1.00 and better 1.00" in text
    # A smoothed track is in the table of all rows, not in the comparison.
    assert "smoothed (not causal)" in page and "smoothed" not in text


def test_pages_of_other_seeds_and_of_parts_compare_over_their_own_units():
    names = [one.name for one in whole_set() if one.part == "hard"]
    files = bench_pages([row(name, np.full(len(names), 0.5), names=names) for name in "ab"])
    table = pd.read_csv(io.StringIO(files[f"{'a' * 12}-hard.csv"]))
    assert set(table["units"]) == {5} and set(table["mean"][:2]) == {0.5}
    names = ["lidar-car-turn-1000"]
    command = ["stixel", "bench", "page", "mine.zip", "--data", "tuning"]
    files = bench_pages([row("mine", [0.5], names=names)], (), command)
    page = files[f"{'a' * 12}.html"]
    assert "other seeds than those of frozen" in page and "mine.zip --data tuning" in page
    assert "Mean IoU: mine 0.500" in files["index.html"]
    names = ["lidar-car-turn-5", "lidar-car-crossing-6", "lidar-car-approach-7"]
    files = bench_pages([row("mine", [0.2, 0.3, 0.4], "fresh", names=names)])
    table = pd.read_csv(io.StringIO(files[f"{'a' * 12}-fresh.csv"]))
    assert table["mean"][0] == pytest.approx(0.3) and table["units"][0] == 3
    assert "fresh seeds of frozen, drawn by a pack" in files["index.html"]


def test_fresh_rows_and_other_processors():
    here = rows()[:2]
    there = [one | {"benchmark": "b" * 64} for one in rows()[:2]]
    # The same sequences, rendered by another processor: one table, in which data name the rows.
    files = bench_pages([*here, *there])
    assert [name for name in files if name.endswith("csv")] == [f"{'a' * 12}.csv"]
    text = files[f"{'a' * 12}.csv"]
    assert f"gp_ekf 1 rerun {'a' * 8}" in text and f"gp_ekf 1 rerun {'b' * 8}" in text
    fresh = row("better", np.full(2, 0.5), "fresh", names=NAMES[:2])
    assert f"{'a' * 12}-fresh.html" in bench_pages([*here, fresh])
    assert "no rows yet" in bench_pages([])["index.html"]


@pytest.mark.parametrize("key", ["benchmark", "pack", "fresh_of", "sequences"])
@pytest.mark.parametrize("place", ["../evil", "{folder}/evil"])
def test_a_row_that_names_a_file_elsewhere_is_refused(key, place, tmp_path, monkeypatch, told):
    name = place.format(folder=tmp_path)
    edited = row("gp_ekf", np.full(len(NAMES), 0.5))
    edited[key] = [name, *NAMES[1:]] if key == "sequences" else name
    folder = tmp_path / "work"
    write_row(edited, folder / "rows")
    monkeypatch.chdir(folder)
    sequences.definitions()
    monkeypatch.setattr(sequences, "bench_folder", lambda: folder)
    (line,) = told("bench", "page", "--rows", "rows", "--output", "site", code=2).splitlines()
    assert key in line or "not the name of a sequence" in line
    assert not (folder / "site").exists() and not list(tmp_path.rglob("evil*"))


def test_bench_page_reads_the_rows_of_a_folder_and_those_that_are_shipped(tmp_path, monkeypatch):
    shipped = bench_folder()
    (tmp_path / "shipped").mkdir()
    shutil.copy(shipped / "sequences.yaml", tmp_path / "shipped")
    write_row(rows()[0], tmp_path / "shipped" / "rows")
    write_row(rows()[1], tmp_path / "rows")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sequences, "bench_folder", lambda: tmp_path / "shipped")
    assert main(["bench", "page", "--rows", "rows", "--output", "site"]) == 0
    page = (tmp_path / "site" / f"{'a' * 12}.html").read_text(encoding="utf-8")
    assert "gp_ekf" in page and "equal" in page
