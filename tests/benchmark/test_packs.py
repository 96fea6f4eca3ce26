import json
import resource
import zipfile
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter

from stixel_cli.benchmark import sequences
from stixel_cli.benchmark.packs import (
    COVARIANCE,
    Manifest,
    late_scans,
    read_rows,
    sequence_scores,
    true_box,
)
from stixel_cli.benchmark.page import bench_pages
from stixel_cli.benchmark.run import no_track
from stixel_cli.benchmark.sequences import Data, named, npz, planned
from stixel_cli.cli.app import main
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import run_experiment

NAME = "fabricated-car-turn-0"
SCHEMA = Path(__file__).parents[2] / "pipelines" / "bench" / "pack.schema.json"


@pytest.fixture
def refused(told):
    """Runs a command that must be refused in one line, and returns that line."""

    def run(*arguments):
        error = told("bench", *arguments, "--data", "data", code=2)
        assert error.count("\n") == 1, error
        return error

    return run


def arrays_of(packed, name=NAME):
    with np.load(packed / "gp_ekf" / f"{name}.npz") as file:
        return dict(file)


def test_the_schema_beside_the_definitions_is_that_of_the_code():
    assert json.loads(SCHEMA.read_text(encoding="utf-8")) == TypeAdapter(Manifest).json_schema()


def test_a_row_has_the_scores_of_stixel_run(packed):
    assert main(["bench", "score", "gp_ekf.zip", "--data", "data", "--rows", "rows"]) == 0
    (row,) = read_rows(packed / "rows")
    (experiment,) = planned([named(NAME)], {"tracker": "gp_ekf"})
    metrics = run_experiment(experiment.composition, pictures=False).metrics
    at = row["sequences"].index(NAME)
    for name in ("iou_mean", "iou_box_mean", "centre_rmse_m", "nees_position_mean", "success"):
        # Points are rounded to 0.1 mm, contours to single precision.
        assert row["scores"][name][at] == pytest.approx(metrics[name], rel=0.01), name
    assert row["benchmark"] == Data(packed / "data").id and row["tier"] == "scored"


def test_the_sequences_of_a_row_open_pages_that_play_back_its_pack(packed, refused, capsys):
    arrays = arrays_of(packed)
    arrays["means"][3] = np.nan
    (packed / "gp_ekf" / f"{NAME}.npz").write_bytes(npz(**arrays))
    assert main(["bench", "pack", "gp_ekf", "--data", "data"]) == 0
    assert main(["bench", "score", "gp_ekf.zip", "--data", "data", "--rows", "rows"]) == 0
    assert "1 scan without an estimate before the next scan: IoU 0" in capsys.readouterr().err
    page = ["bench", "page", "gp_ekf.zip", "--data", "data", "--rows", "rows", "--output", "site"]
    assert main(page) == 0
    names = {f"{name}.html" for name in Data(packed / "data").names}
    assert names < {file.name for file in (packed / "site").iterdir()}
    pages = [file.read_text(encoding="utf-8") for file in (packed / "site").glob("*.html")]
    assert sum(f'"{NAME}.html"' in page for page in pages) == 1
    played = (packed / "site" / f"{NAME}.html").read_text(encoding="utf-8")
    assert "gp_ekf" in played and "NaN" not in played
    (packed / "gp_ekf.zip").write_bytes(b"PK")
    assert "gp_ekf.zip" in refused("page", "gp_ekf.zip", "--output", "other")
    assert not (packed / "other").exists()


FAILING = """
import numpy as np
from stixel_cli import compose
from stixel_cli.tracking.baselines import box

PARAMETERS = compose("tracker=box").configuration.tracker

def track(scans, initial, prior):
    if len(scans.points_world) == COUNT:
        raise ValueError("too many points")
    return box.track(scans, initial, prior, PARAMETERS)
"""


def test_a_sequence_whose_tracker_fails_is_missing_and_an_own_start_is_not_scored(rendered, capsys):
    data = Data(rendered)
    counts = [len(data.read(name).scans.points_world) for name in data.names]
    assert main(["bench", "run", "point", "--own-start", "--data", "data"]) == 0
    assert main(["bench", "score", "point-own-start.zip", "--data", "data", "--rows", "rows"]) == 0
    (row,) = read_rows(rendered.parent / "rows")
    assert row["tracker"]["start"] == "own" and not any(row["scores"]["missing_scans"])
    assert min(row["scores"]["iou_mean"]) > 0.0
    (rendered.parent / "fails.py").write_text(FAILING.replace("COUNT", str(counts[2])))
    capsys.readouterr()
    assert main(["bench", "run", "fails:track", "--data", "data"]) == 0
    said = capsys.readouterr().err
    assert said.count("all scans are missing: the tracker failed: ValueError: too many points") == 1
    assert said.count(f"{data.names[2]}:") >= 1


def test_golden_scores_of_the_true_box_moved_along_the_heading(rendered):
    given = Data(rendered).read(NAME)
    truth = given.truth
    track = true_box(truth)
    along = np.array([np.cos(track["means"][:, 2]), np.sin(track["means"][:, 2])]).T
    moved = track | {"covariances": np.tile(0.25 * np.eye(3), (len(along), 1, 1))}
    moved["means"] = track["means"] + np.column_stack([0.5 * along, np.zeros(len(along))])
    moved["contours"] = track["contours"] + 0.5 * along[:, None]
    scores = sequence_scores(moved, given)
    length = np.ptp(truth.box_target, axis=0)[0]
    assert scores["iou_box_mean"] == pytest.approx((length - 0.5) / (length + 0.5), abs=1e-4)
    assert scores["centre_rmse_m"] == pytest.approx(0.5)
    assert scores["nees_position_mean"] == pytest.approx(0.5) and scores["in_nees_band"] == 1
    assert scores["track_lost"] == scores["orientation_rmse_deg"] == scores["missing_scans"] == 0
    # A contour that runs clockwise is the same contour.
    turned = sequence_scores({**moved, "contours": moved["contours"][:, ::-1]}, given)
    assert turned == scores
    # A scan without an estimate has IoU 0.
    missing = {name: np.array(values) for name, values in moved.items()}
    for name in ("means", "covariances", "contours"):
        missing[name][3] = np.nan
    fewer = sequence_scores(missing, given)
    assert fewer["missing_scans"] == 1
    assert fewer["iou_box_mean"] == pytest.approx(scores["iou_box_mean"] * 11 / 12, abs=1e-5)
    # So has one whose estimate comes after the next scan; the one after it is in time again.
    seconds = np.where(np.arange(12) == 3, 0.15, 0.01)
    assert late_scans(seconds, truth.times).nonzero()[0].tolist() == [3]
    late = sequence_scores({**moved, "seconds": seconds}, given)
    assert late == fewer | {"ms_per_scan": late["ms_per_scan"]}
    assert late_scans(np.array(1.3), truth.times).all()
    nothing = sequence_scores(no_track(12), given)
    assert nothing["iou_mean"] < 1e-9 and nothing["track_lost"] == 1


def test_a_table_gives_the_same_pack_as_arrays(packed):
    with zipfile.ZipFile(packed / "gp_ekf.zip") as archive:
        before = {name: archive.read(name) for name in archive.namelist()}
    arrays = arrays_of(packed)
    means, contours, std = arrays["means"], arrays["contours"], arrays["contour_std"]
    upper = arrays["covariances"].reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]]
    names = ["x", "y", "heading", *COVARIANCE]
    names += [f"p{axis}{i}" for i in range(contours.shape[1]) for axis in "xy"]
    names += [f"std{i}" for i in range(contours.shape[1])] + ["seconds"]
    seconds = np.full((len(means), 1), arrays["seconds"] / len(means))
    rows = np.hstack([means, upper, contours.reshape(len(means), -1), std, seconds])
    file = packed / "gp_ekf" / f"{NAME}.npz"
    file.unlink()
    np.savetxt(file.with_suffix(".csv"), rows, "%.17g", ",", header=",".join(names), comments="")
    assert main(["bench", "pack", "gp_ekf", "--data", "data"]) == 0
    with zipfile.ZipFile(packed / "gp_ekf.zip") as archive:
        for key in ("means", "contours", "contour_std"):
            assert archive.read(f"{NAME}/{key}.npy") == before[f"{NAME}/{key}.npy"], key


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (lambda packed, arrays: None, f"the sequence {NAME} is missing"),
        (lambda packed, arrays: (packed / "data" / NAME / "truth.npz").read_bytes(), "is unknown"),
        (lambda packed, arrays: npz(**arrays | {"means": arrays["means"][:5]}), "means must have"),
        (lambda _, arrays: npz(**arrays | {"covariances": -arrays["covariances"]}), "definite"),
    ],
)
def test_pack_refuses(packed, refused, content, expected):
    file, arrays = packed / "gp_ekf" / f"{NAME}.npz", arrays_of(packed)
    file.unlink()
    if (made := content(packed, arrays)) is not None:
        file.write_bytes(made)
    assert expected in refused("pack", "gp_ekf")


def changed_pack(packed, **members):
    with zipfile.ZipFile(packed / "gp_ekf.zip") as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(packed / "gp_ekf.zip", "w") as archive:
        for name, data in (content | members).items():
            if data is not None:
                archive.writestr(name, data)
    return content


def test_score_and_pack_refuse_unknown_entries_and_what_pack_would_not_have_made(packed, refused):
    content = changed_pack(packed, **{f"{NAME}/means.npy": None})
    assert "means is missing" in refused("score", "gp_ekf.zip")
    manifest = json.loads(content["manifest.json"])
    changed_pack(packed, **(content | {"manifest.json": json.dumps(manifest | {"iou_mean": 0.9})}))
    assert "iou_mean" in refused("score", "gp_ekf.zip")
    changed_pack(packed, **(content | {"manifest.json": json.dumps(manifest | {"benchmark": "0"})}))
    assert "its tracks are of the data 0" in refused("score", "gp_ekf.zip")
    file = packed / "gp_ekf" / "tracker.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"iou_mean": 0.99}))
    assert "tracker.iou_mean: is unknown" in refused("pack", "gp_ekf")


@pytest.mark.parametrize("size", [400 * 2**20, 63 * 2**20])
def test_a_small_pack_of_a_huge_manifest_is_refused(packed, refused, size):
    with zipfile.ZipFile("gp_ekf.zip") as archive:
        members = {one: archive.read(one) for one in archive.namelist()}
    with zipfile.ZipFile("gp_ekf.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            if name != "manifest.json":
                archive.writestr(name, content)
                continue
            with archive.open(name, "w", force_zip64=True) as stream:
                stream.write(b"[")
                for _ in range(size // 2**20):
                    stream.write(b"0," * 2**19)
                stream.write(b"0]")
    assert Path("gp_ekf.zip").stat().st_size < 2**20
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "manifest.json" in refused("score", "gp_ekf.zip", "--rows", "rows")
    grown = 2**10 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    assert grown < 2**30 and not Path("rows").exists()


def test_score_refuses_the_truth_in_the_form_of_a_track(packed, refused):
    data = Data(packed / "data")
    for name in data.names:
        (packed / "gp_ekf" / f"{name}.npz").write_bytes(npz(**true_box(data.read(name).truth)))
    assert main(["bench", "pack", "gp_ekf", "--data", "data"]) == 0
    assert "is the truth, not a track" in refused("score", "gp_ekf.zip")


def test_an_edited_row_is_refused(packed):
    assert main(["bench", "score", "gp_ekf.zip", "--data", "data", "--rows", "rows"]) == 0
    (file,) = (packed / "rows").glob("*.json")
    row = json.loads(file.read_text())
    row["scores"]["iou_mean"][0] = 1.0
    file.write_text(json.dumps(row, sort_keys=True) + "\n")
    with pytest.raises(UserError, match="was edited"):
        read_rows(packed / "rows")


def test_a_pack_draws_fresh_seeds_and_only_they_make_its_row_fresh(packed, refused, monkeypatch):
    monkeypatch.setattr(sequences, "FRESH_SEEDS", 1)
    assert "its seeds are not those" in refused("score", "gp_ekf.zip", "--fresh-of", "gp_ekf.zip")
    assert main(["bench", "score", "gp_ekf.zip", "--data", "data", "--rows", "rows"]) == 0
    assert main(["bench", "render", "--fresh", "gp_ekf.zip", "--data", "fresh"]) == 0
    (packed / "there").mkdir()
    monkeypatch.chdir(packed / "there")
    assert main(["bench", "run", "gp_ekf", "--data", "../fresh"]) == 0
    given = ["--data", "../fresh", "--fresh-of", "../gp_ekf.zip", "--rows", "../rows"]
    assert main(["bench", "score", "gp_ekf.zip", *given]) == 0
    rows = read_rows(packed / "rows")
    assert sorted(row["tier"] for row in rows) == ["fresh", "scored"]
    tables = [name for name in bench_pages(rows) if name.endswith(".csv")]
    assert sum("-fresh" in name for name in tables) == 1 < len(tables)
