"""What every test may use: a cache of its own, away from the user's; and runs that are short."""

import os
from contextlib import contextmanager
from functools import cache
from pkgutil import resolve_name

# Before NumPy is imported: with two threads for each of two test processes, BLAS mostly waits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from browser import open_page as open_page
from rendered_clip import clip as clip

from stixel_cli.engine.cache_folder import make_folder

SHORT = {
    "drawn": {
        "stixel_cli.experiment.run.PICTURES": (),
        "stixel_cli.sweeps.page.sweep_page": lambda *_, **given: "",
    },
    "workers": {"stixel_cli.engine.plan.Durations.estimate": lambda *_: 0.0},
}
"""What is replaced in this process unless a test or its module has the mark.

Drawing, and processes that import all libraries, take nearly all of a short run's time. Runs and
sweeps draw nothing without `drawn`; without `workers` all work of `executor=local` counts as small,
and is done in this process.
"""


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory):
    """A cache folder for the whole session: tests of runs share what they have in common.

    Workers of xdist have a cache each, and share what Hydra has composed.
    """
    cache = tmp_path_factory.mktemp("cache")
    session = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        session = session.parent
    composed = session / "configurations"
    composed.mkdir(exist_ok=True)
    make_folder(cache, "configurations").rmdir()
    (cache / "configurations").symlink_to(composed, target_is_directory=True)
    return cache


@pytest.fixture(scope="session", autouse=True)
def _no_user_cache(shared_cache):
    """For fixtures of any scope, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        yield


@contextmanager
def _runs_of(node):
    """Runs of this process as a module or a test asks for them; afterwards as before."""
    whole = {name: _whole(name) for names in SHORT.values() for name in names}
    with pytest.MonkeyPatch.context() as patch:
        for mark, names in SHORT.items():
            for name, short in names.items():
                patch.setattr(name, whole[name] if node.get_closest_marker(mark) else short)
        yield


_whole = cache(resolve_name)


@pytest.fixture(scope="module", autouse=True)
def _runs_of_module(request):
    """For the module's fixtures, too."""
    with _runs_of(request.node):
        yield


@pytest.fixture(autouse=True)
def _runs_of_test(request, _runs_of_module):
    with _runs_of(request.node):
        yield


def pytest_collection_modifyitems(items):
    """The longest test first: at the end, the other worker would wait for it."""
    items.sort(key=lambda item: item.path.name != "test_bench.py")
