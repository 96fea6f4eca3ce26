import json
from dataclasses import replace

import numpy as np
import pytest

from stixel_cli.benchmark.sequences import Data, fresh_set, named, planned, whole_set
from stixel_cli.cli.app import main
from stixel_cli.errors import UserError
from stixel_cli.results import tables


def test_version_1_0_has_450_sequences_which_their_names_give_back():
    sequences = whole_set()
    assert len(sequences) == len({one.name for one in sequences}) == 360 + 90
    assert [named(one.name) for one in sequences] == sequences
    assert len(whole_set(mini=True)) == 72
    hard = [one for one in sequences if one.part == "hard" and one.seed == 0]
    assert len(planned([one for one in hard if one.road_user == "car"], {})) == 6
    with pytest.raises(UserError, match="not the name of a sequence"):
        named("stixels-car-../../etc-0")


def test_fresh_seeds_follow_from_the_pack_and_nobody_can_have_tuned_on_them():
    one, other = fresh_set("ab"), fresh_set("cd")
    seeds = {sequence.seed for sequence in one}
    assert one == fresh_set("ab") and len(one) == 90 and len(seeds) == 10
    assert min(seeds) >= 10_000 and seeds.isdisjoint(sequence.seed for sequence in other)


def test_a_second_rendering_has_the_same_id_and_a_tracker_gets_what_was_rendered(
    rendered, tmp_path, monkeypatch, capsys
):
    capsys.readouterr()
    assert main(["bench", "verify", "--data", "data"]) == 0
    identity = capsys.readouterr().out.split()[-1]
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "other"))
    assert main(["bench", "render", "--mini", "--data", "again", "--workers", "1"]) == 0
    assert capsys.readouterr().out.split()[-1] == identity == Data(rendered).id
    data = Data(rendered)
    name = "fabricated-car-turn-1"
    given = data.read(name)
    truth = given.truth
    assert len(given.scans) == 12 and given.scans.field_of_view.left > 0.0
    assert given.prior.length == 4.52 and truth.known.all()
    assert np.all(np.linalg.eigvalsh(given.scans.covariances_world) > 0.0)
    assert np.hypot(*(given.initial.mean[:2] - truth.target_poses_world[0, :2])) < 3.0


def test_heights_of_points_come_back_from_a_sequence_and_from_a_run(rendered):
    name = "fabricated-car-turn-1"
    given = Data(rendered).read(name)
    heights = np.linspace(0.2, 1.4, len(given.scans.points_world))
    scans = replace(given.scans, heights=heights)
    for file, content in replace(given, scans=scans).files().items():
        (rendered / name / file).write_bytes(content)
    np.testing.assert_allclose(Data(rendered).read(name).scans.heights, heights, atol=1e-6)
    x, y, heading = scans.sensor_poses_world.T
    ego = {"t": scans.times, "x": x, "y": y, "heading": heading}
    np.testing.assert_array_equal(tables._scans(ego, tables.scan_columns(scans)).heights, heights)


def test_verify_names_a_file_that_was_changed_or_is_missing(rendered, capsys):
    (rendered / "fabricated-car-turn-0" / "start.json").write_text("{}")
    (rendered / "fabricated-car-turn-1" / "truth.npz").unlink()
    capsys.readouterr()
    assert main(["bench", "verify", "--data", "data"]) == 1
    out = capsys.readouterr().out
    assert "fabricated-car-turn-0/start.json: is missing or damaged" in out
    assert "fabricated-car-turn-1/truth.npz: is missing" in out


def test_verify_takes_other_scans_for_those_of_another_processor_but_no_other_truth(
    rendered, capsys
):
    published = json.loads((rendered / "MANIFEST.json").read_text())
    published["files"]["fabricated-car-turn-0/scans.npz"] = "0"
    file = rendered.parent / "definitions" / "MANIFEST-mini.json"
    file.write_text(json.dumps(published))
    capsys.readouterr()
    assert main(["bench", "verify", "--data", "data"]) == 0
    assert (
        "scans.npz of 1 sequence differ: another processor or revision" in capsys.readouterr().err
    )
    published["files"]["fabricated-car-turn-0/truth.npz"] = "0"
    file.write_text(json.dumps(published))
    assert main(["bench", "verify", "--data", "data"]) == 1
    assert "turn-0/truth.npz: differs from the published" in capsys.readouterr().out


@pytest.mark.parametrize("path", ["../../etc/passwd", "a/b", "x/scans.npz/../../y"])
def test_a_manifest_cannot_name_other_files(rendered, path, capsys):
    manifest = rendered / "MANIFEST.json"
    content = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(content | {"files": {path: "0"}}))
    assert main(["bench", "verify", "--data", "data"]) == 2
    assert "not a file of a sequence" in capsys.readouterr().err
