"""`stixel ls` of folders made by hand, and `stixel explain`: why something would run."""

import json

import pytest
from result_folders import CONFIG, make_folder

from stixel_cli.cli.app import main
from stixel_cli.sweeps.folder import SweepFolder, SweepRequest


@pytest.fixture
def results(tmp_path):
    root = tmp_path / "results"
    root.mkdir()
    first = make_folder(root / "first", metrics={"centre_rmse_m": 0.25, "iou_mean": 0.8})
    other = {**CONFIG, "tracker": {"kind": "gp_ekf", "basis_points": 20}}
    make_folder(root / "second", metrics={"centre_rmse_m": 0.5, "iou_mean": 0.8}, config=other)
    manifest = json.loads((first / "manifest.json").read_text())
    manifest |= {"created": "2025-01-01T00:00:00+00:00", "choices": {"path": "turn"}}
    (first / "manifest.json").write_text(json.dumps(manifest))
    return root


def answer(capsys, *words):
    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_ls_lists_runs_oldest_first(results, capsys, monkeypatch):
    make_folder(results / "deep" / "er" / "third")
    make_folder(results / ".half.partial-7")
    (results / "mine").mkdir()
    sweep = results / "sweep"
    make_folder(sweep / "runs" / "0000")
    (sweep / "sweep.yaml").write_text("runs: []\n")
    found = answer(capsys, "ls", str(results))
    runs = [one for one in found if one["kind"] == "run"]
    assert [one["path"].rpartition("/")[2] for one in runs] == ["first", "third", "second"]
    assert [one["path"] for one in found if one["kind"] == "sweep"] == [str(sweep)]
    assert runs[0]["metrics"]["centre_rmse_m"] == 0.25 and runs[0]["verdict"] is None
    whole = json.loads((results / "first" / "metrics.json").read_text())
    lost = json.dumps(whole | {"track_lost": 1})
    (results / "first" / "metrics.json").write_text(lost)
    runs = answer(capsys, "ls", str(sweep / "runs"))
    assert [one["path"] for one in runs] == [f"{sweep}/runs/0000"]
    monkeypatch.setenv("COLUMNS", "400")
    assert main(["ls", str(results)]) == 0
    said = capsys.readouterr().out
    assert said.index("first") < said.index("second")
    assert "0.250" in said and "lost" in said and "verdict" in said


def test_ls_shows_what_differs_and_the_swept_values(tmp_path, capsys):
    choices = {"road_user": "car", "path": "turn"}
    changed = {"choices": choices, "overrides": ["rig=kitti", "seed=3"]}
    make_folder(tmp_path / "one", manifest=changed)
    (found,) = answer(capsys, "ls", str(tmp_path))
    assert found["choices"] == "car turn rig=kitti"
    swept = {"tracker": "point", "tracker.sigma_q": "0.5"}
    runs = tmp_path / "sweep" / "runs"
    make_folder(runs / "0000", manifest=changed | {"swept": swept})
    (found,) = answer(capsys, "ls", str(runs))
    assert found["choices"] == "point sigma_q=0.5"


def make_sweep(folder, axes, runs):
    request = SweepRequest("", False, (), axes, runs, {})
    SweepFolder(folder).create(request)


def test_the_line_of_a_sweep_has_its_values_and_its_number_of_runs(tmp_path, capsys, monkeypatch):
    axes = (("tracker",), ("road_user.mesh",), ("tracker.sigma_f", "tracker.sigma_q"), ("seed",))
    runs = tuple(
        (f"tracker={tracker}", f"road_user.mesh=/m/{mesh}.obj", f"+tracker.sigma_f = {sigma}",
         f"tracker.sigma_q={sigma}", f"seed={seed}")
        for tracker in ("gp_ekf", "contour")
        for mesh in ("a", "b")
        for sigma in ("0.5", "2")
        for seed in range(10)
    )  # fmt: skip
    make_sweep(tmp_path / "one", axes, runs)
    (found,) = answer(capsys, "ls", str(tmp_path))
    assert found["choices"] == (
        "tracker=gp_ekf,contour mesh=a.obj,b.obj sigma_f+1=0.5,2 seed=0..9, 80 runs"
    )
    monkeypatch.setenv("COLUMNS", "400")
    assert main(["ls", str(tmp_path)]) == 0
    shown = found["choices"].replace(",", ", ").replace(",  ", ", ")
    assert shown in " ".join(capsys.readouterr().out.split())


def test_the_line_of_a_long_sweep_is_short(tmp_path, capsys):
    keys = [f"tracker.key_{i}" for i in range(6)]
    runs = tuple(tuple(f"{key}={0.123456 + i}" for key in keys) for i in range(9))
    make_sweep(tmp_path / "one", tuple((key,) for key in keys), runs)
    (found,) = answer(capsys, "ls", str(tmp_path))
    assert found["choices"] == (
        f"{' '.join(f'key_{i}=9 values' for i in range(5))} and 1 more, 9 runs"
    )


@pytest.mark.parametrize("axes", [(), ((),)])
def test_the_line_of_a_sweep_without_axes_is_its_number_of_runs(tmp_path, capsys, axes):
    make_sweep(tmp_path / "one", axes, (("seed=0",),))
    (found,) = answer(capsys, "ls", str(tmp_path))
    assert found["choices"] == "1 run"


def test_ls_of_an_empty_folder_and_of_a_damaged_sweep(tmp_path, capsys):
    assert main(["ls", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert "no result folders" in said.err
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "sweep.yaml").write_text("runs: []\n")
    assert main(["ls", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "one" in said.out
    assert said.err.count("\n") == 1 and "sweep.yaml" in said.err


def test_show(results, capsys):
    folder = results / "first"
    shown = answer(capsys, "ls", str(folder))
    assert shown["settings"]["tracker.basis_points"] == "50"
    assert shown["metrics"]["centre_rmse_m"] == 0.25
    assert main(["ls", str(folder)]) == 0
    said = capsys.readouterr().out
    for text in ("stixel run seed=0", "path=turn", "0123456789ab with", "0.250", "2025"):
        assert text in said
    (results / "first" / "manifest.json").write_text(
        '{"stages": [1, {"name": null}], "git": 3, "versions": [], "choices": "x"}'
    )
    assert main(["ls", str(results / "first")]) == 0


def test_show_of_a_sweep(tmp_path, capsys):
    folder = tmp_path / "sweep"
    words = ["measurement=fabricated", "path.duration=0.3", "tracker=point,box", "--name", "sweep"]
    assert main(["sweep", *words, "--results", str(tmp_path)]) == 0
    shown = answer(capsys, "ls", str(folder))
    assert [row["status"] for row in shown["runs"]] == ["done", "done"]
    assert main(["ls", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "2 done" in said and "centre" in said
    assert main(["verify", str(folder)]) == 2
    assert f"one of its runs, such as {folder}/runs/0000" in capsys.readouterr().err
    assert main(["verify", f"{folder}/runs/0001", "--cached"]) == 0
    assert "identical: 2 files" in capsys.readouterr().out


def test_compare_shows_what_differs_and_what_is_alike(results, capsys):
    folders = [str(results / name) for name in ("first", "second")]
    found = answer(capsys, "ls", *folders)
    assert found["settings"]["tracker.basis_points"] == {"first": "50", "second": "20"}
    assert found["metrics"] == {"centre_rmse_m": {"first": 0.25, "second": 0.5}}
    assert main(["ls", *folders]) == 0
    said = capsys.readouterr().out
    assert "tracker.basis_points" in said
    assert "0.250" in said and "due to chance" in said
    assert "road_user.length" not in said
    make_folder(results / "alike", metrics={"centre_rmse_m": 0.5, "iou_mean": 0.8})
    make_folder(results / "too", metrics={"centre_rmse_m": 0.5, "iou_mean": 0.8})
    assert main(["ls", str(results / "alike"), str(results / "too")]) == 0
    said = capsys.readouterr().out
    assert "the settings are the same" in said
    assert "the metrics are the same" in said


def test_brackets_in_names_are_no_markup(results, capsys):
    folder = make_folder(results / "[bold]x[")
    assert main(["ls", str(folder)]) == 0
    assert main(["ls", str(results)]) == 0
    assert "[bold]x[" in capsys.readouterr().out


pytestmark = pytest.mark.sketched

FABRICATED = ("measurement=fabricated", "path.duration=0.3", "pictures.frames=[0]")


@pytest.fixture(scope="module")
def explained_folder(tmp_path_factory):
    """A result folder, and a cache that holds its results."""
    root = tmp_path_factory.mktemp("explained")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(root / "cache"))
        assert main(["run", *FABRICATED, "--results", str(root), "--name", "first"]) == 0
    return root / "first"


@pytest.fixture
def explained(explained_folder, capsys, monkeypatch):
    """What `stixel explain` says, by stage."""
    monkeypatch.setenv("STIXEL_CACHE", str(explained_folder.parent / "cache"))

    def explain(*words):
        capsys.readouterr()
        assert main(["explain", "--json", *words]) == 0
        found = json.loads(capsys.readouterr().out)
        return {one["stage"]: [why["text"] for why in one["why"]] for one in found}

    return explain


def test_what_would_run_of_a_folder_and_of_overrides(
    explained, explained_folder, capsys, monkeypatch, tmp_path
):
    assert explained(*FABRICATED) == {}
    assert explained(str(explained_folder)) == {}
    assert main(["explain", str(explained_folder)]) == 0
    assert capsys.readouterr().out == "nothing to recompute: all results are cached\n"
    why = explained(*FABRICATED, "tracker.sigma_f=0.77")
    assert any("sigma_f changed from" in text and "to 0.77" in text for text in why["track"])
    assert why["scores"] == ["input changed: track"]
    assert main(["explain", *FABRICATED, "tracker.sigma_f=0.77"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("track: ")
    assert main(["explain", str(explained_folder), "seed=1"]) == 2
    assert "either one result folder or overrides" in capsys.readouterr().err
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "none"))
    capsys.readouterr()
    assert main(["explain", str(explained_folder)]) == 0
    assert "new: no result of track is stored" in capsys.readouterr().out
    assert not (tmp_path / "none").exists()
