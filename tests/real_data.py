"""Real data, which lie beside the checkout or where STIXEL_DATA says."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("STIXEL_DATA", Path(__file__).parents[1] / "../shared/data"))


def real_data(name: str) -> Path:
    """The folder of this name; without it the test is skipped."""
    if not (DATA / name).is_dir():
        pytest.skip(f"no real data: STIXEL_DATA names no folder with {name} ({DATA})")
    return DATA / name
