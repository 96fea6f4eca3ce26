import pytest

from stixel_cli.geometry.rig import Rig


@pytest.fixture
def rig():
    return Rig(320, 160, None, 300.0, None, None, 0.5, 1.4, 0.0, None)
