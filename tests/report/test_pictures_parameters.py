"""Which frames are pictured."""

import pytest

from stixel_cli.results.pictures import PicturesParameters


def test_frames_must_increase():
    PicturesParameters(None).check()
    PicturesParameters(()).check()
    PicturesParameters((0, 3, 9)).check()
    for frames in ((3, 3), (5, 2)):
        with pytest.raises(ValueError, match=r"pictures\.frames"):
            PicturesParameters(frames).check()
