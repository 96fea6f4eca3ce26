"""No edit of the shipped code, configuration or of a file that a stage reads is served stale."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
WEDGE = "v 1 1 3\nv 3 1 3\nv 1 2 3\nv 1 1 4\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def test_every_edit_changes_the_keys_of_its_stages(tmp_path):
    for name in ("stixel_cli", "conf", "pipelines"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "wedge.obj").write_text("mtllib wedge.mtl\n" + WEDGE)
    (tmp_path / "wedge.mtl").write_text("newmtl coat\nmap_Kd none.png\n")
    (tmp_path / "scans.csv").write_text("k,t,x,y\n0,0.0,1,9\n1,0.1,1,9\n")
    (tmp_path / "truth.csv").write_text("k,x,y,heading,length,width\n0,0,10,0,4,2\n")
    ours = {"PYTHONPATH": str(tmp_path), "STIXEL_CACHE": str(tmp_path / "cache")}
    program = Path(__file__).with_name("edits_of_a_copy.py")
    # -P: only the copy is on the path before what is installed.
    done = subprocess.run(
        [sys.executable, "-P", str(program)],
        cwd=tmp_path,
        env={**os.environ, **ours},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert sum(found["counts"].values()) >= 25
    assert found["stale"] == []
