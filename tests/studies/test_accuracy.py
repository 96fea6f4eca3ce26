"""The study of the trackers' accuracy: tiny, by the real command line."""

import csv
import importlib.util
import re
import shutil
from pathlib import Path

import pytest
import yaml

from stixel_cli.config.compose import compose
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.texts import override_text
from stixel_cli.scene.mesh_file import load_mesh
from stixel_cli.studies.accuracy.report import ABLATIONS, OWN_TABLES, WRONG_CLASSES
from stixel_cli.studies.file import find_study, read_study

SMALL = {
    "path.duration": 0.2,
    "path.start": [0.3, 9.0],
    "rig.width": 160,
    "rig.height": 120,
    "executor": "threads",
}
MESHES = sorted((shipped_folder("pipelines") / "studies" / "meshes").glob("*/*.obj"))


@pytest.fixture
def tiny(tmp_path):
    """The file of the shipped study with fewer values, frames and pixels."""
    content = yaml.safe_load(find_study("accuracy").read_text(encoding="utf-8"))
    variants = content["sweeps"]["ablation"]["variants"]
    for name in ABLATIONS:
        content["sweeps"][name] |= {
            "variants": {name: variants[name] for name in ("–", "Student weights")},
            "axes": {"road_user": ["pedestrian"], "path": ["turn"]},
            "seeds": [0, 1],
            "fixed": content["sweeps"][name]["fixed"] | SMALL,
        }
    priors = {name: {"prior": name} for name in ("pedestrian", "car")}
    axes = {"road_user": ["pedestrian"], "path": ["turn"]}
    for name in WRONG_CLASSES:
        wrong = content["sweeps"][name]
        wrong |= {
            "axes": axes,
            "variants": priors,
            "fixed": wrong["fixed"] | SMALL,
            "seeds": [0, 1],
        }
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
        if name == "held_out":
            sweep |= {"axes": {"path": ["turn"], "tracker": ["gp_ekf", "contour"]}, "seeds": [0]}
            continue
        users = ["car"] if name == "fabricated_car" else ["pedestrian"]
        sweep["axes"] = {
            **sweep["axes"],
            "road_user": users,
            "path": ["turn", "s_curve"] if name == "simulated" else ["turn"],
            "tracker": ["gp_ekf", "contour"],
        }
        if name == "lidar":
            sweep["axes"]["measurement"] = ["lidar"]
        sweep["seeds"] = [0, 1] if name in ("simulated", "fabricated") else [0]
    file = tmp_path / "accuracy.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def load_script(name):
    """The module of a script in docs/."""
    script = Path(__file__).parents[2] / "docs" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"{name}_script", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def load_page(folder):
    """The script docs/accuracy.py with a copy of its page in `folder`."""
    module = load_script("accuracy")
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
    assert (folder / "figures" / "scenes.svg").exists()
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
    assert {row["road user"] for row in table(folder, "held_out")} == {
        file.stem.replace("_", " ") for file in MESHES
    }
    for name in WRONG_CLASSES:
        right, other = table(folder, name)
        assert (right["prior"], other["prior"]) == ("pedestrian", "car")
        assert (right["loss, mean IoU"], float(other["loss, mean IoU"]) > 0.0) == ("", True)
    page = load_page(tmp_path)
    page.main(folder)
    text = page.PAGE.read_text(encoding="utf-8")
    assert "| pedestrian | Student weights |" in text
    assert "Not measured yet" not in text and text.count("<!--") == 2


@pytest.mark.parametrize("name", ABLATIONS)
def test_each_variant_of_the_ablation_switches_one_term_off(name):
    (sweep,) = [one for one in read_study(find_study("accuracy")).sweeps if one.name == name]
    (axis,) = [axis for axis in sweep.design().axes if len(axis.keys) > 1]
    steps = [tuple(one.text for one in step) for step in axis.steps]
    texts = [
        tuple(override_text(key, value) for key, value in own.items())
        for own in sweep.variants.values()
    ]
    assert texts == steps
    whole, *others = map(set, texts)
    changed = [tuple(text.partition("=")[0] for text in own - whole) for own in others]
    assert len(changed) == len(set(changed)) == 8
    assert {key for keys in changed for key in keys} == set(axis.keys)
    # The first is the tracker as it is.
    plain = ["tracker=contour", "road_user=cyclist", "measurement=lidar_64"]
    assert compose([*plain, *steps[0]]).configuration == compose(plain).configuration


def test_the_shipped_study_has_ten_seeds_with_a_shape_each():
    study = read_study(find_study("accuracy"))
    fewer = {"long_range": 2, "one_mesh": 3, "held_out": 3, "peers": 3}
    for sweep in study.sweeps:
        assert sweep.content["seeds"] == fewer.get(sweep.name, 10)
        linked = sweep.content["fixed"].get("road_user.shape_seed")
        assert linked == (None if sweep.name in ("one_mesh", "held_out") else "${seed}")


def test_the_held_out_meshes_are_those_that_the_script_makes(tmp_path):
    script = load_script("held_out_meshes")
    script.FOLDER = tmp_path
    script.main()
    made = {str(f.relative_to(tmp_path)): f.read_bytes() for f in tmp_path.glob("*/*/*.obj")}
    assert {file.parent.name for file in MESHES} == {"car", "cyclist", "pedestrian"}
    shapes = sorted((shipped_folder("pipelines") / "studies" / "shapes").glob("*/*.obj"))
    files = [*MESHES, *shapes]
    assert made == {
        str(file.relative_to(MESHES[0].parents[2])): file.read_bytes() for file in files
    }
    for file in files:
        assert len(load_mesh(str(file), 0.6).parts)
