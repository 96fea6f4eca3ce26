import shutil

import pytest
from made_clip import make_clip


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    """Folder of a small clip in KITTI tracking's layout; not to be changed."""
    folder = tmp_path_factory.mktemp("clip")
    make_clip(folder)
    return folder


@pytest.fixture
def copy(clip, tmp_path):
    """The clip, to damage."""
    return shutil.copytree(clip, tmp_path / "clip")
