import json
import os
from pathlib import Path

import pytest

from stixel_cli.config.compose import compose
from stixel_cli.engine.graph import build_graph
from stixel_cli.experiment.stages import pipeline_stages, scan_count
from stixel_cli.scene.mesh_references import referred_files


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "maps").mkdir()
    for name in ("maps/body.png", "a b.png", "data.bin", "beside.png"):
        (tmp_path / name).write_bytes(b"1")
    (tmp_path / "car.mtl").write_text(
        "newmtl a\nmap_Kd -clamp on maps\\body.png\nmap_Bump a b.png\nKd 1 1 1\nmap_Ka none.png\n"
    )
    (tmp_path / "car.obj").write_text("# a car\nmtllib none.mtl car.mtl\nv 0 0 0\n")
    return tmp_path


def names(folder: Path, mesh: str) -> set[str]:
    return {str(path.relative_to(folder)) for path in referred_files(folder / mesh)}


def test_what_is_referred_to_and_there(folder):
    assert names(folder, "car.obj") == {"car.mtl", "maps/body.png", "a b.png"}
    tree = {
        "buffers": [{"uri": "data.bin"}, {"uri": "data:text/plain,a"}],
        "images": [{"uri": "a%20b.png"}, {"bufferView": 1}],
    }
    (folder / "car.gltf").write_text(json.dumps(tree))
    assert names(folder, "car.gltf") == {"data.bin", "a b.png"}
    (folder / "car.ply").write_bytes(b"ply\ncomment TextureFile a b.png\nend_header\n\xff\x00")
    assert names(folder, "car.ply") == {"a b.png"}


@pytest.mark.parametrize(
    "mesh", ["none.obj", "car.stl", "bad.gltf", "deep.gltf", "maps", "fifo.obj", "zero.mtl"]
)
def test_nothing_is_referred_to(folder, mesh):
    (folder / "car.stl").write_bytes(b"solid car.mtl")
    (folder / "bad.gltf").write_text("[")
    (folder / "deep.gltf").write_text("[" * 100_000)
    (folder / "zero.mtl").symlink_to("/dev/zero")
    os.mkfifo(folder / "fifo.obj")
    assert names(folder, mesh) == set()


def test_a_changed_texture_changes_the_keys_of_what_reads_the_mesh(folder):
    def keys():
        overrides = [f"road_user.mesh={folder / 'car.obj'}"]
        configuration = compose(overrides).configuration
        count = scan_count(configuration)
        return build_graph(pipeline_stages(configuration), count, count).stages

    before = keys()
    (folder / "beside.png").write_bytes(b"2")
    assert keys() == before
    (folder / "maps/body.png").write_bytes(b"2")
    after = keys()
    assert after["render"] != before["render"] and after["scenario"] != before["scenario"]
    assert after["ego_motion"] == before["ego_motion"]
