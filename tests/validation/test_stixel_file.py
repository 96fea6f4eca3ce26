"""Stixels in files of other tools and of our own."""

from pathlib import Path

import numpy as np
import pytest
from real_data import real_data
from refusals import refused

from stixel_cli.cli.app import main
from stixel_cli.errors import UserError
from stixel_cli.rendering.images import encode_png
from stixel_cli.validation.stixel_file import read_stixels

OWN = "left,right,top,base,disparity,depth\n"


def written(folder, text, name="stixels.csv"):
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    return folder / name


def test_tables_of_ours_and_of_theirs_are_read(tmp_path):
    read = read_stixels(written(tmp_path, OWN + "6,9,10,20,12.5,8\n0,3,11,21,12,9\n"))
    stixels = read.stixels
    assert stixels.left.tolist() == [0, 6] and stixels.right.tolist() == [3, 9]
    assert stixels.base.tolist() == [21, 20] and stixels.disparity.tolist() == [12.0, 12.5]
    assert stixels.depth.tolist() == [9.0, 8.0] and stixels.offsets.tolist() == [0, 2]
    assert read.image.shape == (22, 9, 3) and not read.has_size
    text = "img,u,vT,vB,d,label\na.png,16,10,20,7.5,1\na.png,0,8,16,9.5,1\na.png,8,8,16,9.5,1\n"
    stixels = read_stixels(written(tmp_path, text)).stixels
    assert stixels.left.tolist() == [0, 8, 16] and stixels.right.tolist() == [8, 16, 24]
    assert stixels.base.tolist() == [15, 15, 19] and np.isnan(stixels.disparity).all()


def test_stx1_has_widths_and_the_image(tmp_path):
    library = pytest.importorskip("stixel")
    world = library.StixelWorld()
    world.image = encode_png(np.full((40, 60), 7, np.uint8))
    world.stixel.add(u=5, vT=10, vB=20, d=7.5, width=4)
    read = read_stixels(written(tmp_path, world.SerializeToString(), "one.stx1"))
    assert read.has_size and read.image.shape == (40, 60, 3) and (read.image == 7).all()
    assert (read.stixels.right[0], read.stixels.base[0]) == (9, 19)
    world.stixel.add(u=58, vT=10, vB=20, d=7.5, width=4)
    with pytest.raises(UserError, match=r"one\.stx1: row 1: its columns are not in 0 to 60"):
        read_stixels(written(tmp_path, world.SerializeToString(), "one.stx1"))
    with pytest.raises(UserError, match=r"not a \.stx1 file"):
        read_stixels(written(tmp_path, b"\xff\xff no protobuf", "one.stx1"))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a,b\n1,2\n", "must be .stx1, or have the columns left, "),
        ("u,vT,vB\n1,2,3\n", "the column d is missing"),
        (OWN + "3,3,1,2,9,9\n", "line 2: its columns are not in"),
        (OWN + "0,3,1,2,9,9\n0,3,5,4,9,9\n", "line 3: its rows are not in"),
        (OWN + "0,9000,1,2,9,9\n", "line 2: its columns are not in 0 to 4096"),
        (OWN + "0,3,1,2,9,-9\n", "line 2: its depth is not in"),
        (OWN + "0,3,1,2,0,9\n", "line 2: its disparity is not > 0"),
        (OWN + "0,3,1,2,nan,9\n", "must be a finite number"),
        (OWN + "0,3,1,x,9,9\n", "base: 'x' is not a number"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(text, fault, tmp_path):
    with refused(fault):
        read_stixels(written(tmp_path, text))


def test_without_truth_the_page_has_a_picture_and_names_what_is_missing(
    tmp_path, monkeypatch, capsys, told
):
    monkeypatch.chdir(tmp_path)
    file = written(tmp_path, OWN + "0,3,10,20,12.5,8\n6,12,11,21,12,9\n")
    said = told("assess", "--stixels", file)
    assert "75.0 % of the columns have a stixel." in said and "--disparity" in said
    page = Path("assess.html").read_text()
    assert page.count("data:image/png") == 1 and "<h2>Time</h2>" not in page
    assert main(["assess"]) == 2 and "--stixels FILE" in capsys.readouterr().err


@pytest.mark.parametrize(("suffix", "count"), [("stx1", 1022), ("csv", 624)])
def test_files_of_another_tool_are_read(suffix, count):
    if suffix == "stx1":
        pytest.importorskip("stixel")
    (file,) = real_data("stixel_formats").glob(f"*.{suffix}")
    read = read_stixels(file)
    assert len(read.stixels.left) == count
    assert np.all(read.stixels.right - read.stixels.left == 8)
