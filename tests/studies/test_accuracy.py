"""The study of the trackers' accuracy: tiny, by the real command line."""

import csv
import importlib.util
import re
import shutil
from pathlib import Path

import pytest
import yaml

from stixel_cli.config.compose import compose
from stixel_cli.studies.accuracy.ablation import TERMS
from stixel_cli.studies.accuracy.report import ABLATIONS, OWN_TABLES, WRONG_CLASSES
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
    (zipped,) = content["sweeps"]["ablation"]["zipped"]
    for name in ABLATIONS:
        content["sweeps"][name] |= {
            "zipped": [{key: values[:2] for key, values in zipped.items()}],
            "axes": {"road_user": ["pedestrian"], "path": ["turn"]},
            "seeds": [0, 1],
            "fixed": content["sweeps"][name]["fixed"] | SMALL,
        }
    priors = {"road_user": ["pedestrian"], "prior": ["pedestrian", "car"], "path": ["turn"]}
    for name in WRONG_CLASSES:
        wrong = content["sweeps"][name]
        wrong |= {"axes": priors, "fixed": wrong["fixed"] | SMALL, "seeds": [0, 1]}
    peers = content["sweeps"]["peers"]
    names = ["full_scgp", "ggiw"]
    peers["axes"] = {"road_user": ["pedestrian"], "path": ["turn"], "tracker.name": names}
    peers["fixed"], peers["seeds"] = {**peers["fixed"], **SMALL}, [0]
    for name, sweep in content["sweeps"].items():
        if name in (*OWN_TABLES, "peers"):
            continue
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


def load_page(folder):
    """The script docs/accuracy.py with a copy of its page in `folder`."""
    script = Path(__file__).parents[2] / "docs" / "accuracy.py"
    spec = importlib.util.spec_from_file_location("accuracy_page", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.PAGE = Path(shutil.copy(module.PAGE, folder))
    return module


def table(folder, name):
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_tiny_study_gives_a_complete_report(studies, tiny, tmp_path):
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
    assert (folder / "figures" / "answer_forest.svg").exists()
    near = table(folder, "long_range")
    assert all(row["mean IoU, hull"] != "" and row["mean IoU, box"] != "" for row in near)
    for name in ABLATIONS:
        assert [(row["road user"], row["without"]) for row in table(folder, name)] == [
            ("pedestrian", "–"),
            ("pedestrian", "Student weights"),
        ]
    assert [row["tracker"] for row in table(folder, "peers")] == [
        "PyRecEst full_scgp",
        "PyRecEst ggiw",
    ]
    for name in WRONG_CLASSES:
        right, other = table(folder, name)
        assert (right["prior"], other["prior"]) == ("pedestrian", "car")
        assert (right["loss, mean IoU"], float(other["loss, mean IoU"]) > 0.0) == ("", True)
    goals = table(folder, "goals")
    assert {row["met"] for row in goals} <= {"yes", "no"}
    assert {row["measurement"] for row in goals} == {"simulated", "long range", "fabricated"}
    assert all(row["value"] != "" for row in goals)
    page = load_page(tmp_path)
    page.main(folder)
    text = page.PAGE.read_text(encoding="utf-8")
    assert "| pedestrian | Student weights |" in text
    assert "Not measured yet" not in text and text.count("<!--") == 2


@pytest.mark.parametrize("name", ABLATIONS)
def test_each_variant_of_the_ablation_switches_one_known_term_off(name):
    (axis,) = [
        axis
        for sweep in read_study(find_study("accuracy")).sweeps
        if sweep.name == name
        for axis in sweep.design().axes
        if len(axis.keys) > 1
    ]
    keys = [key.removeprefix("tracker.") for key in axis.keys]
    whole, *others = axis.steps
    left_out = [
        tuple(k for k, a, b in zip(keys, whole, step, strict=True) if a != b) for step in others
    ]
    assert sorted(left_out) == sorted(TERMS.values())
    # The first is the tracker as it is.
    plain = ["tracker=contour", "road_user=cyclist", "measurement=lidar_64"]
    assert compose([*plain, *whole]).configuration == compose(plain).configuration


def test_the_shipped_study_has_ten_seeds_with_a_shape_each():
    study = read_study(find_study("accuracy"))
    fewer = {"long_range": 2, "one_mesh": 3, "peers": 3}
    for sweep in study.sweeps:
        assert sweep.content["seeds"] == fewer.get(sweep.name, 10)
        linked = sweep.content["fixed"].get("road_user.shape_seed")
        assert linked == (None if sweep.name == "one_mesh" else "${seed}")
