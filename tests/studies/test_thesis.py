"""The study of the thesis's experiment: tiny, by the real command line, and its parts."""

import csv
import re
from pathlib import Path

import pandas as pd
import pytest
import yaml

from stixel_cli.config.folders import group_options
from stixel_cli.report.cost import on_cores
from stixel_cli.report.scan_frame import UPPER_BOUNDS, upper_bounds_table
from stixel_cli.report.tables import mean_cell
from stixel_cli.studies.file import find_study, read_study
from stixel_cli.studies.thesis.report import CONSISTENCY, settings_rows, tracking_table

USERS = ["car", "cyclist", "pedestrian"]
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
    content = yaml.safe_load(find_study("thesis").read_text(encoding="utf-8"))
    for name, sweep in content["sweeps"].items():
        sweep["fixed"] |= SMALL
        axes = sweep["axes"]
        axes |= {"road_user": ["pedestrian"], "path": ["turn"]}
        sweep.pop("zipped", None)
        for key in axes:
            if key.startswith("measurement.noise"):
                axes[key] = axes[key][1:3]
        if "ego" in axes:
            axes["ego"] = ["parked", "turning"] if name == "fabricated" else ["parked"]
        sweep["seeds"] = [0] if sweep["fixed"]["measurement"] == "stixels" else [0, 1]
    content["sweeps"]["pictures"]["fixed"]["pictures.frames"] = [1]
    file = tmp_path / "thesis.yaml"
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
    assert "Pedestrian, the thesis: on fabricated measurements mean IoU 0." in text
    assert "times the sample time T on one core" in text
    page = (folder / "report.html").read_text(encoding="utf-8")
    for heading in ("Pedestrian case", "Simulated measurements", "Extended target tracking"):
        assert heading in page
    assert page.count("data:image/webp;base64,") == 1
    figures = {path.stem for path in (folder / "figures").glob("*.svg")}
    assert {"pedestrian_paths", "pedestrian_rays", "pedestrian_radius_1"} <= figures
    assert {
        "pedestrian_parked_over_time_iou",
        "answer_forest",
        "constant_noise",
        "stereo_noise",
    } <= figures
    rows = table(folder, "answer")
    assert {row["measurement"] for row in rows} == {"fabricated", "simulated"}
    assert {row["n"] for row in rows} == {"1", "2"}
    sources = {row["option or key"]: row["source"] for row in table(folder, "settings")}
    assert sources["tracker.sigma_f"].startswith("paper") and "ours" in sources["tracker.sigma_f"]
    assert {row["rates"] for row in table(folder, "starts")} == {"zero", "truth"}
    assert {row["matcher"] for row in table(folder, "matchers")} == {"sgm", "bm"}
    assert [row["σ (m)"] for row in table(folder, "constant_noise_table")] == ["0.05", "0.1"]
    for row in table(folder, "real_time"):
        assert 0.0 < float(row["two cores at least / T"]) <= float(row["one core / T"])


def test_the_shipped_study_has_every_case_on_seeds_from_0():
    study = read_study(find_study("thesis"))
    sweeps = {sweep.name: sweep.content for sweep in study.sweeps}
    fabricated = sweeps["fabricated"]["axes"]
    assert set(fabricated["path"]) == {*group_options()["path"]} - {"recorded"}
    assert fabricated["ego"] == ["parked", "straight", "turning"]
    (simulated,) = sweeps["simulated"]["zipped"]
    assert set(simulated["path"]) == {"turn", "crossing", "approach"}
    assert set(simulated["ego"]) == {*fabricated["ego"]}
    levels = sweeps["constant_noise"]["axes"]["measurement.noise.range_std"]
    assert (levels[0], levels[-1]) == (0.0, 0.5)
    for sweep in sweeps.values():
        assert sweep["axes"]["road_user"] == USERS
        seeds = sweep["seeds"]
        assert isinstance(seeds, int) or seeds[0] == 0


def test_settings_have_a_value_for_each_kernel_and_a_source():
    found = settings_rows(["thesis", "thesis_improved"], USERS)
    rows = {(own := tuple(row.values()))[0]: own[1:] for row in found}
    assert rows["tracker.sigma_f"][:2] == ("2", "by class")
    assert rows["measurement/noise"][:2] == ("constant", "constant")
    assert rows["measurement.noise.disparity_std"][0] == "0.0212"
    assert rows["start.velocity"][0] == "by class"
    assert all(re.match("thesis|paper|ours", row[2]) for row in rows.values())


def test_kernels_are_columns():
    runs = pd.DataFrame(
        {
            "road_user": "car",
            "ego": ego,
            "tracker": kernel,
            "seed": seed,
            "centre_rmse_m": 0.5 + seed,
            "orientation_rmse_deg": 2.0,
            "iou_mean": 0.5,
            "nees_position_mean": 3.0,
            "nis_mean": 1.0,
            "iou_hull_mean": 0.6,
            "iou_box_mean": 0.7,
            "low_overlap_share": 0.0,
            "track_lost": float(seed == 1),
        }
        for ego in ("parked", "straight")
        for kernel in ("one", "other")
        for seed in ((0, 1) if ego == "parked" or kernel == "one" else ())
    )
    found = tracking_table("t", runs, ("road_user", "ego"))
    assert [row[:4] for row in found.rows] == [
        ("car", "parked", 2, 1.0),
        ("car", "straight", 2, 1.0),
    ]
    # A kernel without runs has no values.
    assert found.rows[1][12:] == (None,) * 9
    parked = runs[runs["ego"] == "parked"]
    assert tracking_table("c", parked, ("ego",), CONSISTENCY, mean_cell).rows[0][2] == 3.0
    upper_bounds = runs.assign(**{name: i / 10 for i, name in enumerate(UPPER_BOUNDS)})
    assert upper_bounds_table("c", upper_bounds, ("ego",)).rows == (
        ("parked", 2, 0.0, 0.1, 0.2, 0.3),
        ("straight", 2, 0.0, 0.1, 0.2, 0.3),
    )


def test_two_cores_need_half_of_the_work_and_each_stage_that_is_in_order():
    assert on_cores({"match": 0.3, "track": 0.1}) == (0.4, 0.2)
    assert on_cores({"match": 0.1, "track": 0.5}) == (0.6, 0.5)
    assert on_cores({}) == (0, 0)
