"""The studies of the trackers away from home: tiny, by the real command line."""

import csv
import re
from pathlib import Path

import pytest
import yaml

from stixel_cli.studies.file import find_study

SMALL = {
    "path.duration": 0.2,
    "path.start": [0.3, 9.0],
    "rig.width": 160,
    "rig.height": 120,
    "executor": "threads",
}
FEW = {"tracker": ["contour", "no_data"]}


def tiny(folder, name, change):
    """The file of a shipped study with `change` (sweep's name and content) applied."""
    content = yaml.safe_load(find_study(name).read_text(encoding="utf-8"))
    for sweep in [*content["sweeps"]]:
        if not change(sweep, content["sweeps"][sweep]):
            del content["sweeps"][sweep]
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def table(folder, name):
    with (Path(folder) / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_tiny_study_has_a_table_for_each_departure(studies, tmp_path):
    def change(name, sweep):
        sweep["seeds"] = [0]
        sweep["fixed"] = {**sweep["fixed"], **SMALL}
        sweep["axes"] = {**sweep["axes"], **FEW}
        for key, values in (("road_user", ["car"]), ("path", ["turn"])):
            if key in sweep["axes"]:
                sweep["axes"][key] = values
        if name in ("following", "curved"):
            del sweep["fixed"]["path.start"]
        if name == "gaps":
            sweep["fixed"]["path.duration"] = 1.0
            sweep["axes"]["measurement.dropout"] = [[0.1, 0.2]]
        return True

    answer = studies.run(tiny(tmp_path, "robustness", change))
    assert answer["complete"], answer
    text = " ".join(answer["answer"])
    assert not re.search(r"\bnan\b|\binf\b", text) and "gaps of 1 to 3 s" in text
    shapes = table(answer["folder"], "shapes")
    names = ("cargo bike", "rectangle", "l shape", "rectangle", "trapezium")
    assert {row["shape"].partition(",")[0] for row in shapes} == {*names}
    assert len(shapes) == 2 * len(names)
    (row, _) = table(answer["folder"], "gaps")
    assert (row["gap"], row["found again"] in ("0.0", "1.0")) == ("0.1 s", True)
    assert [row["error"] for row in table(answer["folder"], "miscalibrated")][::2] == [
        "-0.3 px",
        "+0.3 px",
    ]
    curved = [row["calibration"] for row in table(answer["folder"], "curved")]
    assert sorted(curved) == ["motion"] * 2 + ["none"] * 2
    assert [row["tracker"] for row in table(answer["folder"], "following")] == FEW["tracker"]


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    """A folder of data with made-up tables: two targets of a lidar, one run of a scenario."""
    for name in ("pandaset/car-a", "pandaset/pedestrian-b", "lidarrm/default-00"):
        folder = tmp_path / "data" / name
        folder.mkdir(parents=True)
        places = [(k, 0.1 * k, 0.3 * k, 20.0) for k in range(12)]
        scans = [
            "k,t,x,y",
            *(f"{k},{t},{x + side},{y}" for k, t, x, y in places for side in (0, 1)),
        ]
        truth = ["k,x,y,heading,length,width", *(f"{k},{x},{y + 1},0,4,2" for k, _, x, y in places)]
        ego = ["k,t,x,y,heading", *(f"{k},{t},0,0,1.57" for k, t, _, _ in places)]
        for table_name, lines in (("scans", scans), ("truth", truth), ("ego", ego)):
            (folder / f"{table_name}.csv").write_text("\n".join(lines) + "\n")
    monkeypatch.setenv("STIXEL_DATA", str(tmp_path / "data"))


def test_recordings_are_those_of_the_users_data(studies, recordings, tmp_path):
    def change(name, sweep):
        sweep |= {"axes": sweep["axes"] if name == "lidarrm_peers" else FEW, "seeds": [0]}
        return name != "clip"

    answer = studies.run(tiny(tmp_path, "robustness_real", change))
    assert answer["complete"], answer
    targets = [row["target"] for row in table(answer["folder"], "pandaset")]
    assert targets == ["car-a", "car-a", "pedestrian-b", "pedestrian-b", *["mean of the cars"] * 2]
    (row, _) = table(answer["folder"], "lidarrm")
    assert (row["scans"], row["tracker"], row["n"]) == ("default", "contour", "1")
    peers = [row["tracker"] for row in table(answer["folder"], "lidarrm_peers")]
    assert peers == ["lidar_random_matrix", "li_random_matrix", "gm_mem_ekf"]


def test_without_data_one_line_names_the_variable(studies, monkeypatch):
    monkeypatch.delenv("STIXEL_DATA", raising=False)
    assert "STIXEL_DATA: must name a folder that has pandaset" in studies.refused("robustness_real")
