"""`stixel report`, and `--play`: the page of stored runs, from configuration and cache."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from boxes import write_box

from stixel_cli.cli.app import main
from stixel_cli.cli.report import report
from stixel_cli.config.compose import compose
from stixel_cli.engine.store import open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import run_experiment


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
def test_report_prints_its_page_or_writes_where_it_is_told(folders, capsys, tmp_path):
    assert report(folders, None) == 0
    sentence, page = capsys.readouterr().out.strip().rsplit("\n", 1)
    assert sentence.startswith("Mean IoU: two 0.600 and one 0.500")
    page = Path(page)
    assert page == folders[0].parent / "report-one-two.html"
    assert "two 0.600" in page.read_text()
    assert report(folders, None) == 0
    assert capsys.readouterr().out.strip().endswith("report-one-two-2.html")
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
    with pytest.raises(UserError, match="--compare: is for one sweep"):
        report(folders, form="md", compare="seed")


FABRICATED = ("measurement=fabricated", "path.duration=0.5", "pictures.frames=[]")
FABRICATED += ("executor=threads",)


@pytest.fixture(scope="module")
def results(tmp_path_factory, shared_cache):
    """Folders as a sweep's runs have them: `one`, `again`, `point` of one scene, and `faster`."""
    root = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        for name, *overrides in (
            ("one",),
            ("again",),
            ("point", "tracker=point"),
            ("faster", "path.speed=7.5"),
        ):
            make_point(root / name, [*FABRICATED, *overrides])
    (root / "sweep").mkdir()
    (root / "sweep" / "sweep.yaml").write_text("runs: []\n")
    return root


def make_point(folder, overrides):
    composition = compose(overrides)
    store = open_store(composition.configuration.cache)
    result = run_experiment(composition, pictures=False, store=store)
    folder.mkdir()
    (folder / "config.yaml").write_text(yaml.safe_dump(composition.resolved))
    (folder / "manifest.json").write_text(json.dumps({"choices": composition.choices}))
    (folder / "metrics.json").write_text(json.dumps(result.metrics))


def page_data(file):
    text = file.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, flags=re.DOTALL).group(1))


def play(capsys, *words):
    capsys.readouterr()
    code = main(["report", "--play", *map(str, words)])
    said = capsys.readouterr()
    return code, said.out.strip(), said.err.strip()


@pytest.mark.sketched
def test_a_runs_folder_holds_its_page(tmp_path):
    assert main(["run", *FABRICATED, "--name", "mine", "--results", str(tmp_path)]) == 0
    folder = tmp_path / "mine"
    data = page_data(folder / "index.html")
    with np.load(folder / "track.npz") as track:
        contours = track["contours_world"]
    stored = np.reshape(data["runs"][0]["contours"], contours.shape)
    assert np.allclose(1e-3 * stored, contours, atol=0.5001e-3)
    assert data["title"] == "mine"
    assert ["measurement", "fabricated"] in data["runs"][0]["facts"]
    assert data["cameras"] == []
    origin = data["runs"][0]["origin"]
    assert origin["command"] == json.loads((folder / "manifest.json").read_text())["command"]
    assert origin["made"][1].startswith("revision ")
    for _, target in origin["links"]:
        assert (folder / target).exists()
    # The page has the time and the command, which `verify` does not compare.
    (folder / "index.html").write_text("another page")
    assert main(["verify", str(folder), "--cached"]) == 0
    for place in (folder, tmp_path):
        assert main(["ls", str(place)]) == 0


def test_runs_on_one_scene_are_called_by_their_trackers_or_folders(results, tmp_path, capsys):
    page = tmp_path / "both.html"
    code, out, _ = play(capsys, results / "one", results / "point", "--output", page)
    assert (code, out) == (0, str(page))
    data = page_data(page)
    assert [run["label"] for run in data["runs"]] == ["gp_ekf", "point"]
    assert data["notes"] == []
    assert len(data["scans"]) == 1
    assert "not overwritten" in play(capsys, results / "one", "--output", page)[2]
    page = tmp_path / "same.html"
    folders = [results / name for name in ("one", "again", "point")]
    assert play(capsys, *folders, "--output", page)[0] == 0
    data = page_data(page)
    assert data["title"] == "one, again and point on one scene"
    one, other, _ = data["runs"]
    assert (one["label"], other["label"]) == ("one", "again")
    assert one["contours"] == other["contours"]


def test_a_mesh_of_ones_own_is_named(tmp_path, capsys):
    mesh = write_box(tmp_path / "barrow.obj")
    make_point(tmp_path / "own", [*FABRICATED, f"road_user.mesh={mesh}"])
    assert play(capsys, tmp_path / "own")[0] == 0
    facts = page_data(tmp_path / "play-own.html")["runs"][0]["facts"]
    assert ["mesh", "barrow.obj"] in facts


def test_a_page_is_written_beside_its_folder_and_over_none(results, capsys):
    copies = [play(capsys, results / "point")[1] for _ in range(2)]
    assert copies == [str(results / name) for name in ("play-point.html", "play-point-2.html")]


def test_results_that_come_out_differently_are_said(results, tmp_path, capsys):
    copy = tmp_path / "altered"
    copy.mkdir()
    for file in ("config.yaml", "manifest.json", "metrics.json"):
        (copy / file).write_bytes((results / "one" / file).read_bytes())
    metrics = json.loads((copy / "metrics.json").read_text())
    (copy / "metrics.json").write_text(json.dumps(metrics | {"iou_mean": 0.1}))
    code, _, err = play(capsys, copy)
    assert code == 0
    assert "altered: this version gives different results" in err
    assert len(page_data(tmp_path / "play-altered.html")["notes"]) == 1


@pytest.mark.parametrize(
    ("folders", "said"),
    [
        (("one", "faster"), "path.speed is 3 in one and 7.5 in faster"),
        (("one", "one"), "two arguments name the same folder"),
        (("none",), "no such folder"),
        (("sweep",), "sweep.yaml: "),
    ],
)
def test_what_cannot_be_played_is_refused_in_one_line(results, folders, said, capsys):
    before = sorted(results.iterdir())
    code, _, err = play(capsys, *(results / name for name in folders))
    assert code == 2
    assert said in err
    assert "\n" not in err
    assert sorted(results.iterdir()) == before


@pytest.mark.sketched
def test_a_sweep_of_one_scene_is_played_and_its_page_links_to_the_player(tmp_path, capsys):
    words = ["sweep", *FABRICATED, "tracker=point,box", "--name", "both"]
    assert main([*words, "--results", str(tmp_path)]) == 0
    code, said, _ = play(capsys, tmp_path / "both")
    assert (code, said) == (0, str(tmp_path / "both/index.html"))
    assert len(page_data(tmp_path / "both/play.html")["runs"]) == 2
    assert '<a href="play.html">' in (tmp_path / "both/index.html").read_text(encoding="utf-8")
