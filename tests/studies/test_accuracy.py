"""The study of the trackers' accuracy: tiny, by the real command line."""

import csv
import re
from pathlib import Path

import pytest
import yaml

from stixel_cli.studies.file import find_study, read_study

SMALL = {
    "path.duration": 0.3,
    "path.start": [0.3, 9.0],
    "rig.width": 160,
    "rig.height": 120,
    "executor": "threads",
}


@pytest.fixture
def tiny(tmp_path):
    """The file of the shipped study with fewer values, frames and pixels."""
    content = yaml.safe_load(find_study("accuracy").read_text(encoding="utf-8"))
    for name, sweep in content["sweeps"].items():
        sweep["fixed"] = {**sweep["fixed"], **SMALL}
        if name == "long_range":
            del sweep["fixed"]["rig"]
        users = ["car"] if name == "fabricated_car" else ["pedestrian"]
        sweep["axes"] = {
            **sweep["axes"],
            "road_user": users,
            "path": ["turn"] if name == "long_range" else ["turn", "s_curve"],
            "tracker": ["gp_ekf", "contour"],
        }
        if name == "lidar":
            sweep["axes"]["measurement"] = ["lidar"]
        sweep["seeds"] = [0, 1] if name in ("simulated", "fabricated") else [0]
    file = tmp_path / "accuracy.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def table(folder, name):
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_tiny_study_gives_a_complete_report(studies, tiny):
    answer = studies.run(tiny)
    folder = Path(answer["folder"])
    assert answer["complete"], answer
    text = " ".join(answer["answer"])
    assert not re.search(r"\bnan\b|\binf\b", text)
    assert "Pedestrian, simulated measurements: " in text
    rows = table(folder, "simulated")
    assert {row["path"] for row in rows} == {"mean of paths", "s_curve"}
    assert {row["n"] for row in rows} == {"2"}
    assert len(rows) == 4
    assert {row["measurement"] for row in table(folder, "fabricated")} == {"fabricated"}
    assert {row["road user"] for row in table(folder, "fabricated")} == {"car", "pedestrian"}
    near = table(folder, "long_range")
    assert all(row["mean IoU, hull"] == "" and row["mean IoU, box"] != "" for row in near)


def test_the_shipped_study_has_ten_seeds_with_a_shape_each():
    study = read_study(find_study("accuracy"))
    for sweep in study.sweeps:
        assert sweep.content["seeds"] == 10
        linked = sweep.content["fixed"].get("road_user.shape_seed")
        assert linked == (None if sweep.name == "one_mesh" else "${seed}")
