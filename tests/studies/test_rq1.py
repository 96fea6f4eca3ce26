"""RQ1's report: on a tiny study by the real command line, and its sweeps by themselves."""

import csv
import io
import re
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from PIL import Image

from stixel_cli.config.compose import compose
from stixel_cli.geometry.rig import Rig
from stixel_cli.report.scan_frame import stage_pictures
from stixel_cli.scene.parameters import RoadUser
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.studies.file import find_study, read_study
from stixel_cli.studies.rq1.errors import matcher, needed_disparity, road_user
from stixel_cli.studies.rq1.setup import seconds_a_frame, timed_building, values_of

FIXED = {
    "rig.width": 144,
    "rig.height": 108,
    "path.start": [-0.3, 12.0],
    "path.duration": 1.0,
    "path.sample_time": 0.5,
    "path.speed": 4.0,
    "pictures.frames": [1],
    "executor": "threads",
}
AXES = {
    "road_user": ["pedestrian"],
    "rig": ["default", "kitti"],
    "occupancy": ["polar", "cartesian"],
    "road_user.contrast": [0.3, 0.6],
}


@pytest.fixture
def tiny(tmp_path):
    """The file of the shipped study with fewer values, frames and pixels."""
    content = yaml.safe_load(find_study("rq1").read_text(encoding="utf-8"))
    for name, sweep in content["sweeps"].items():
        if name == "widths":
            sweep["fixed"] |= {
                "path.start": [0.3, 12.0],
                "path.duration": 0.5,
                "executor": "threads",
            }
            sweep["fixed"] |= {"rig.width": 320, "rig.height": 240}
            continue
        sweep["fixed"] = sweep["fixed"] | FIXED
        sweep["axes"] = {key: AXES[key] for key in sweep["axes"]}
        sweep["seeds"] = [0]
    file = tmp_path / "rq1.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def test_a_tiny_study_gives_a_complete_report(studies, tiny):
    answer = studies.run(tiny)
    folder = studies.results / "rq1"
    assert answer["complete"], answer
    assert "No stixel is on a road user between 25 and 31 m" in answer["answer"][0]
    assert not re.search(r"\bnan\b|\binf\b", " ".join(answer["answer"]))
    names = {path.stem for path in (folder / "figures").glob("*.svg")}
    assert names == {
        "disparity",
        "matchers",
        "locking",
        "free_space",
        "grids",
        "height",
        "depth",
        "normalised",
        "coverage",
        "rigs",
        "contrast",
    }
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/webp;base64,") == 1
    assert "Badino" in page and len(page) < 4_000_000
    with (folder / "tables/disparity.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    seen = [row for row in rows if int(row["pixels"]) > 0]
    assert {row["range m"] for row in seen} <= {"5–10", "10–20"} and len(seen) >= 2
    for row in seen:
        assert 0.0 <= float(row["density %"]) <= 100.0
    for table in ("disparity", "matchers", "grids", "height", "stixels"):
        header = (folder / f"tables/{table}.csv").read_text(encoding="utf-8").partition("\n")[0]
        assert header.count(",low ") == header.count(",high ") >= 4, table
    with (folder / "tables/rigs.csv").open(encoding="utf-8") as file:
        rigs = list(csv.DictReader(file))
    assert [row["rig"] for row in rigs] == ["default", "KITTI"]
    assert float(rigs[1]["needed px"]) == pytest.approx(721.5377 * 0.5327 * 0.1 / 28**2)
    assert [row["achieved RMS px"] for row in rigs] == ["", ""]
    with (folder / "tables/widths.csv").open(encoding="utf-8") as file:
        widths = list(csv.DictReader(file))
    assert [row["width"] for row in widths] == ["1 px", "3 px", "1 px, one point of 3"]
    points = [float(row["points a scan"]) for row in widths]
    assert points[0] > 2.0 * points[1] and points[2] == pytest.approx(points[0] / 3, rel=0.1)
    with (folder / "tables/seconds.csv").open(encoding="utf-8") as file:
        seconds = list(csv.DictReader(file))
    assert {row["sweep"] for row in seconds} == {"rigs", "matchers", "grids"}
    assert all(float(row["match"]) > 0.0 for row in seconds)


def test_each_sweep_of_the_shipped_study_changes_one_setting():
    study = read_study(find_study("rq1"))
    sweeps = {sweep.name: sweep for sweep in study.sweeps}
    assert list(sweeps) == ["ranges", "matchers", "grids", "rigs", "contrast", "widths", "gallery"]
    approach = sweeps["ranges"].content["fixed"]
    shapes = {"road_user.shape_seed": "${seed}"}
    assert sweeps.pop("widths").content["fixed"] == {"road_user": "car", "path": "turn"} | shapes
    for sweep in sweeps.values():
        fixed = dict(sweep.content["fixed"])
        fixed.pop("pictures.frames", None)
        assert fixed == approach, sweep.name
        assert sweep.content["axes"]["road_user"] == ["car", "cyclist", "pedestrian"]
        own = [key for key in sweep.content["axes"] if key != "road_user"]
        assert len(own) + len(sweep.content.get("zipped") or []) <= 1, sweep.name
    frames = round(approach["path.duration"] / approach["path.sample_time"])
    last = approach["path.start"][1] - (frames - 1) * approach["path.sample_time"] * 5.0
    assert approach["path.start"][1] > 50.0 and last <= 5.3


def test_the_required_disparity_precision_depends_on_the_rig():
    rig = Rig(640, 480, 60.0, None, None, None, 0.3, 1.2, 0.0, None)
    needed = needed_disparity(rig)
    assert needed == pytest.approx(0.0212, abs=1e-4)
    disparity = rig.disparity_from_depth(28.0)
    assert rig.depth_from_disparity(disparity - needed) - 28.0 == pytest.approx(0.1, rel=0.01)


def test_runs_have_the_names_of_matcher_and_road_user():
    def run(*overrides):
        return SimpleNamespace(configuration=compose(overrides).configuration, setting={})

    runs = [
        run("stereo=bm"),
        run("road_user=cyclist"),
        run("stereo.subpixel=parabola"),
        run("stereo.subpixel=phase_table"),
    ]
    assert [matcher(p) for p in runs] == ["BM", "SGM", "SGM (one match)", "SGM (phase table)"]
    assert [road_user(p) for p in runs] == ["car", "cyclist", "car", "car"]


def test_cpu_seconds_per_frame_and_values_of_a_scene():
    runs = [
        SimpleNamespace(cpu_seconds={"match": 2.0}, scores=SimpleNamespace(times=np.zeros(4))),
        SimpleNamespace(cpu_seconds={"match": 6.0}, scores=SimpleNamespace(times=np.zeros(4))),
    ]
    seconds = seconds_a_frame(runs)
    assert seconds["match"] == 1.0 and seconds["render"] is None
    short = values_of(compose().configuration)
    longer = values_of(compose(["path=stop_and_go"]).configuration)
    turning = values_of(compose(["ego=turning"]).configuration)
    # Speed and yaw rate; a turn has side and radius, stop-and-go three times in their place.
    assert turning == short + 2 and longer == short + 1
    user = RoadUser("pedestrian", 0.6, 0.35, 1.75, 0.6, None, None, 1.0, "x")
    built = timed_building(lambda: [road_user_meshes(user)[0]])
    assert built["CPU seconds"] > 0.0
    assert built["triangles"] == sum(len(p.triangles) for p in road_user_meshes(user)[0].parts)


def test_a_picture_of_all_stages_is_that_of_its_frame():
    def png(colour):
        buffer = io.BytesIO()
        Image.new("RGB", (40, 20), colour).save(buffer, "png")
        return buffer.getvalue()

    files = {"k0017/camera.png": png("red"), "k0003/left.png": b"", "k0003/camera.png": png("blue")}
    run = SimpleNamespace(load=lambda stage: [SimpleNamespace(files=files)])
    (first, picture), (second, _) = stage_pictures("gallery", run)
    assert (first, second, picture.name) == (3, 17, "gallery_0003")
    pixel = Image.open(io.BytesIO(picture.data)).convert("RGB").getpixel((20, 10))
    assert np.allclose(pixel, (0, 0, 255), atol=12)
