"""Packs and rows of the benchmark with damaged places, by the commands that read them."""

import io
import json
import zipfile
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import yaml
from damage import damage_tree
from damaged_arrays import ARRAYS, npy
from harness_of_fuzz import Kind, run_cases, settle

from stixel_cli.benchmark import sequences
from stixel_cli.benchmark.sequences import Data, bench_folder
from stixel_cli.cli.app import main

SMALL = 8

FROZEN = {"seeds": {"fabricated": [0, 1]}, "cases": {"turn": {"path": "turn"}}}
DEFINITIONS = {"version": "1.0", "whole": ["frozen"], "road_users": ["car"], "mini_seeds": [0, 1]}
DEFINITIONS |= {"parts": {"frozen": FROZEN}}
DEFINITIONS |= {"sensors": {"fabricated": {"measurement": "fabricated", "path.duration": 1.2}}}


def damaged(text, rng, place):
    """A JSON text with one or two places of another value, away, or far too deep."""
    file = place / "damaged.json"
    file.write_text(text, encoding="utf-8")
    damage_tree(file, rng)
    text = file.read_text(encoding="utf-8")
    file.unlink()
    return text


@pytest.fixture(scope="module")
def original(tmp_path_factory, shared_cache):
    """Two sequences, a pack, its rows and those that are shipped."""
    place = tmp_path_factory.mktemp("bench")
    (place / "sequences.yaml").write_text(yaml.safe_dump(DEFINITIONS))
    shipped = bench_folder() / "rows"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        patch.chdir(place)
        patch.setattr(sequences, "bench_folder", lambda: place)
        sequences.definitions.cache_clear()
        names = ["fabricated-car-turn-0", "fabricated-car-turn-1"]
        only = [word for name in names for word in ("--only", name)]
        assert main(["bench", "render", "--data", "data", *only]) == 0
        assert main(["bench", "run", "no_data", "--data", "data"]) == 0
        assert main(["bench", "score", "no_data.zip", "--data", "data", "--rows", "rows"]) == 0
        for file in sorted(shipped.glob("*.json"))[::8]:
            row = json.loads(file.read_text())
            row["sequences"] = names
            row["scores"] = {name: column[:2] for name, column in row["scores"].items()}
            (place / "rows" / file.name).write_text(json.dumps(row))
        (place / "rows").rename(place / "originals")
        yield place
    sequences.definitions.cache_clear()


def members(file):
    with zipfile.ZipFile(file) as archive:
        return {one.filename: archive.read(one) for one in archive.infolist()}


def draw_pack(rng, place, contents):
    """Score or play a pack with a damaged manifest or array."""
    contents = dict(contents)
    if rng.random() < 0.5:
        contents["manifest.json"] = damaged(contents["manifest.json"].decode(), rng, place)
    else:
        name = rng.choice([name for name in contents if name.endswith(".npy")])
        contents[name] = npy(rng.choice(ARRAYS)(np.load(io.BytesIO(contents[name]))))
        if rng.random() < 0.1:
            del contents[name]
    with zipfile.ZipFile(place / "pack.zip", "w") as archive:
        for name, content in contents.items():
            how = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
            archive.writestr(name, content, compress_type=how)
    return rng.choice((["score", "pack.zip"], ["page", "pack.zip"]))


def draw_words(rng, place, original):
    """A command of `stixel bench` on a damaged pack or row."""
    for file in (*place.glob("rows/*"), place / "pack.zip"):
        file.unlink(missing_ok=True)
    (place / "rows").mkdir(exist_ok=True)
    if not (place / "data").exists():
        (place / "data").symlink_to(original / "data")
    if rng.random() < 0.5:
        words = draw_pack(rng, place, members(original / "no_data.zip"))
    else:
        files = sorted((original / "originals").iterdir())
        text = damaged(rng.choice(files).read_text(), rng, place)
        digest = sha256(text.encode()).hexdigest()[:16]
        (place / "rows" / f"{digest}.json").write_text(text)
        words = ["page"]
    more = ["--output", "site"] if words[0] == "page" else []
    return ["bench", *words, "--data", "data", "--rows", "rows", *more]


def test_each_is_answered(original, tmp_path, monkeypatch):
    place = settle(monkeypatch, tmp_path)
    assert Data(original / "data").names

    def outside(words, got):
        return "written outside" if Path("/tmp/evil").exists() else ""

    make = partial(draw_words, original=original)
    run_cases(Kind("benchmark file", make, place, outside, may_write=True), SMALL)
