"""The moving picture of the README: small, and what its script writes of a run with images."""

import re

import numpy as np
import pytest
from PIL import Image
from test_settings_page import DOCS, load_script

moving_picture = load_script("moving_picture")
MOST_BYTES = 1_500_000


def test_readme_begins_with_it_and_it_is_small():
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"!\[[^\]]+\]\(([^)]+)\)", readme)
    assert DOCS.parent / shown[1] == moving_picture.FILE
    assert moving_picture.FILE.stat().st_size < MOST_BYTES
    with Image.open(moving_picture.FILE) as picture:
        assert picture.n_frames == 100


@pytest.mark.drawn
def test_each_frame_of_the_run_is_shown(tmp_path):
    file = tmp_path / "picture.gif"
    small = ["path.duration=0.3", "rig.width=320", "rig.height=240", "pictures.frames=[]"]
    moving_picture.main(small, file)
    with Image.open(file) as picture:
        assert picture.n_frames == 3
        first = np.asarray(picture.convert("RGB"))
    assert first.shape[0] == moving_picture.HEIGHT
    assert np.ptp(first[:, : moving_picture.WIDTH]) > 100  # the camera's image
    colours = {tuple(pixel) for pixel in first[:, moving_picture.WIDTH :].reshape(-1, 3)}
    assert len(colours) > 5  # axes, points and contours
