"""Made-up recordings, tables, meshes and presets with one or two files damaged.

Commands that compose read the recordings and the presets; the readers of images, tables and meshes
are called as the stages call them.
"""

import random
import shutil
import sys
import warnings
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from damage import damage, restore
from harness_of_fuzz import Answer, Kind, answer, run_cases, settle
from PIL import Image

from stixel_cli.config.compose import compose
from stixel_cli.config.folders import use_presets
from stixel_cli.errors import UserError
from stixel_cli.live.pairs import rig_of
from stixel_cli.measurements.file import read_scans
from stixel_cli.measurements.file_truth import read_truth
from stixel_cli.measurements.scans import Scans
from stixel_cli.recordings.image_files import image_size, read_image
from stixel_cli.rendering.images import eight_bits
from stixel_cli.scene.mesh_file import load_mesh
from stixel_cli.tracking.file import FileTrackParameters, track
from stixel_cli.validation.track_doubts import track_doubts

sys.path.append(str(Path(__file__).parents[1] / "recordings"))
from made_argoverse import make_log
from made_bag import messages, write_bag
from made_clip import make_clip
from made_drive import make_drive, make_official
from made_files import RIG_FILES, png_of

SMALL = 10

CLIP = "source.folder=clip source.sequence=0003 source.target="
ALL = f"run --json --dry-run {CLIP}auto road_user=car"
OF_A_CLIP = (f"run --dry-run {CLIP}0", ALL, f"explain {CLIP}0")
RAW = "source.folder=drives/2011_09_26_drive_0001_sync source.target="
OFFICIAL = "run --dry-run source.folder=drives/official source.sequence=0003 source.target=0"
OF_A_DRIVE = (f"run --dry-run {RAW}0", f"explain {RAW}auto road_user=car", OFFICIAL)
CAR = "road_user=car rig.camera_height=1.6"
OF_A_LOG = [f"run --dry-run source.folder=log source.target=auto {CAR}"]
BAGS = {"first.bag": "mcap", "second": "mcap", "third": "sqlite3"}
ODOMETRY = f"source.odometry_topic=/odom {CAR} start.range=[5,15]"
OF_A_BAG = [f"run --dry-run source.folder=bags/{bag} {ODOMETRY}" for bag in BAGS]
MINE = "--config-dir presets"
OF_PRESETS = (f"run --dry-run {MINE} rig=mine", f"run --json --dry-run {MINE} tracker=coarse")
OF_PRESETS += (f"plan {MINE} experiment=quick",)
OF_FOLDER = {"clip": OF_A_CLIP, "drives": OF_A_DRIVE, "log": OF_A_LOG, "bags": OF_A_BAG}
OF_FOLDER |= {"presets": OF_PRESETS}
PRESETS = {
    "rig/mine": "defaults:\n  - default\n  - _self_\n\nwidth: 320\n",
    "tracker/coarse": "defaults:\n  - gp_ekf\n  - _self_\n\nbasis_points: 12\n",
    "experiment/quick": "# @package _global_\ndefaults:\n  - override /path: crossing\n"
    "path: {duration: 0.5}\n",
}
TABLES = {
    "scans": "k,t,x,y,xx,xy,yy\n0,0.0,1,9,1,0,1\n1,0.1,1.5,9,1,0,1\n",
    "ego": "k,t,x,y,heading\n0,0.0,0,0,1.5\n1,0.1,0,0.1,1.5\n",
    "truth": "k,x,y,heading,length,width\n0,0,10,0.0,4,2\n1,0.1,10,0.0,4,2\n",
    "scans_of_times": "t;x;y\n1584532800100000000;1,5;9\n1584532800200000000;;\n",
    "ego_of_times": "t\tx\ty\theading\n1584532800.1\t0\t0\t1.5\n1584532800.2\t0\t0\t1.5\n",
    "truth_of_times": "t,x,y,heading,length,width\n1584532800100,0,10,0.0,4,2\n",
}
TRACKS = {
    "track.csv": "k,t,x,y,heading,length,width\n0,0.0,1,9,1,4,2\n1,0.1,1.5,9,1,4,2\n",
    "times.csv": "t,x,y,heading,radius_0,radius_1,radius_2\n0.01,1,9,1,1,1,1\n0.1,1.5,9,1,1,1,1\n",
    "track.tum": "# t x y z qx qy qz qw\n0.0 1 9 0 0 0 0.6 0.8\n0.1 1.5 9 0 0 0 0.6 0.8\n",
    "0000.txt": "0 3 Car 0 0 0 1 2 3 4 1.5 2 4 1 1.6 9 0.1\n"
    "1 3 Car 0 0 0 1 2 3 4 1.5 2 4 2 1.6 9 0.1\n",
}
OF_MESH = {"material.mtl": "box.obj", "material_0.png": "box.obj"}
OF_MESH |= {f"gltf_buffer_{i}.bin": "model.gltf" for i in range(5)}
"""Files that meshes refer to."""


def write_meshes(folder: Path) -> None:
    """A box in every format that is read, with a texture where it may have one."""
    mesh = trimesh.creation.box((4.0, 2.0, 1.5))
    mesh.export(folder / "binary.ply")
    (folder / "box.ply").write_bytes(mesh.export(file_type="ply", encoding="ascii"))
    image = Image.fromarray(np.full((4, 4, 3), 90, np.uint8))
    mesh.visual = trimesh.visual.TextureVisuals(np.full((8, 2), 0.5), image=image)
    for name in ("box.obj", "box.off", "box.stl", "box.glb"):
        mesh.export(folder / name)
    for name, data in mesh.export(file_type="gltf").items():
        (folder / name).write_bytes(data)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A clip, a log, presets, tables and meshes."""
    place = tmp_path_factory.mktemp("foreign")
    make_clip(place / "clip")
    make_log(place / "clip", place / "log")
    make_drive(place / "clip", place / "drives")
    shutil.copytree(place / "clip", place / "drives/official")
    make_official(place / "drives/official")
    (place / "bags").mkdir()
    for name, plugin in BAGS.items():
        write_bag(place / "bags" / name, messages(place / "clip", "mono8"), plugin)
    for name, text in PRESETS.items():
        (place / "presets" / name).parent.mkdir(parents=True)
        (place / "presets" / f"{name}.yaml").write_text(text)
    for folder in ("tables", "tracks", "meshes", "rigs", "images"):
        (place / folder).mkdir()
    for name, text in RIG_FILES.items():
        (place / "rigs" / name).write_text(text)
    for i, (bits, colour, row) in enumerate(((8, 6, 8), (8, 4, 4), (16, 2, 12), (1, 0, 1))):
        (place / "images" / f"{i}.png").write_bytes(png_of(bits, colour, range(row)))
    (place / "images" / "palette.png").write_bytes(png_of(8, 3, [1, 0], bytes(range(6))))
    for i in (1, 3):
        image = np.arange(1200 * i, dtype=np.uint8).reshape(30, 40, i)
        cv2.imwrite(str(place / "images" / f"{i}.jpg"), image)
    for name, text in TRACKS.items():
        (place / "tracks" / name).write_text(text)
    for name, text in TABLES.items():
        (place / "tables" / f"{name}.csv").write_text(text)
    write_meshes(place / "meshes")
    return place


EMPTY = np.zeros((0, 2)), np.zeros((0, 2, 2))
SCANS = Scans.of_each([0.0, 0.1, 0.2], np.zeros((3, 3)), [EMPTY] * 3)


def draw_words(rng: random.Random, place: Path, original: Path) -> list[str]:
    """A command about foreign files, or a reader and its file, with the files damaged."""
    restore(place, original)
    use_presets(None)
    read = ("tables", "tables", "tracks", "meshes", "rigs", "images")
    folder = rng.choice((*OF_FOLDER, "presets", *read))
    files = sorted(one for one in (place / folder).rglob("*") if one.is_file())
    chosen = rng.choice(files)
    damage(chosen, rng)
    if rng.random() < 0.2:
        damage(rng.choice([one for one in files if one != chosen]), rng)
    if folder == "tables":
        return ["read tables", "_of_times" if "_of_times" in chosen.name else ""]
    if folder == "meshes":
        return ["read mesh", f"meshes/{OF_MESH.get(chosen.name, chosen.name)}"]
    if folder in ("tracks", "rigs", "images"):
        return [f"read {folder[:-1]}", str(chosen)]
    if chosen.suffix == ".png" and rng.random() < 0.5:
        return ["read image", str(chosen)]
    return rng.choice(OF_FOLDER[folder]).split()


def read_or_answer(words: list[str]) -> Answer:
    """The answer of a command, or of the reader that a stage calls."""
    try:
        with warnings.catch_warnings(action="error"):
            if words[0] == "read tables":
                names = ("scans", "ego", "truth")
                scans, ego, truth = (f"tables/{name}{words[1]}.csv" for name in names)
                read_truth(read_scans(scans, ego, 0.1), truth)
            elif words[0] == "read track":
                parameters = FileTrackParameters("file", words[1], None, 0, "camera")
                prior = compose(["road_user=car"]).configuration.prior
                found = track(SCANS, None, prior, parameters)
                track_doubts(parameters, SCANS, found, SCANS.sensor_poses_world)
            elif words[0] == "read mesh":
                load_mesh(words[1], 0.5)
            elif words[0] == "read image":
                image_size(Path(words[1]))
                eight_bits({"image": read_image(Path(words[1]))})
            elif words[0] == "read rig":
                rig_of(words[1], (96, 160))
            else:
                return answer(words)
    except (UserError, ValueError) as error:
        return Answer(2, "", f"stixel: {error}\n")
    return Answer(0, "read", "")


def test_each_is_answered(folders, tmp_path, monkeypatch):
    place = settle(monkeypatch, tmp_path)
    make = partial(draw_words, original=folders)
    run_cases(Kind("foreign file", make, place, may_write=True, answer=read_or_answer), SMALL)
    use_presets(None)
