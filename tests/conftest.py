"""What every test may use: a cache of its own, away from the user's."""

import os

# Before NumPy is imported: with two threads for each of two test processes, BLAS mostly waits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from browser import open_page as open_page


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory):
    """A cache folder for the whole session: tests of runs share what they have in common."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def _no_user_cache(shared_cache, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(shared_cache))
