"""Which frames are pictured."""

from types import SimpleNamespace

import pytest

from stixel_cli.results.pictures import PicturesParameters

PATH, MEASUREMENT = SimpleNamespace(duration=1.0, sample_time=0.1), SimpleNamespace(kind="lidar")


def test_frames_must_increase():
    PicturesParameters(None).check(PATH, MEASUREMENT)
    PicturesParameters(()).check(PATH, MEASUREMENT)
    PicturesParameters((0, 3, 9)).check(PATH, MEASUREMENT)
    for frames in ((3, 3), (5, 2)):
        with pytest.raises(ValueError, match=r"pictures\.frames"):
            PicturesParameters(frames).check(PATH, MEASUREMENT)


def test_frames_end_with_the_path_unless_a_file_has_them():
    with pytest.raises(ValueError, match="<= 9, the last frame, got 10"):
        PicturesParameters((9, 10)).check(PATH, MEASUREMENT)
    PicturesParameters((9, 10)).check(PATH, SimpleNamespace(kind="file"))
