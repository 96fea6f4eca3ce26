"""What every test may use: a cache of its own, away from the user's, and short runs."""

import gc
import os

# Before NumPy is imported: with two threads for each of two test processes, BLAS mostly waits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Else every process of a test would compile all modules anew, which takes longer than its work.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

import hypothesis
import pytest
from browser import browser as browser
from browser import open_page as open_page
from rendered_clip import clip as clip

# What is imported and collected lives to the end: without this a tenth of the time goes to
# looking through it for garbage.
gc.set_threshold(50_000, 20, 10)

# The same examples in every run, and no fault because the machine is busy.
hypothesis.settings.register_profile("same", derandomize=True, deadline=None, max_examples=20)
hypothesis.settings.load_profile("same")


def pytest_sessionstart(session):
    """Where tests run; the first process of xdist would only keep the others waiting.

    For the same reason this module imports stixel in its functions.
    """
    config = session.config
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        from remembered import remember

        remember()


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory):
    """A cache folder for the whole session, all workers of xdist included.

    Tests of runs share what they have in common, such as a rendered scene.
    """
    session = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        session = session.parent
    return session / "cache"


@pytest.fixture
def told(capsys):
    """Runs a command that ends with `code`, and returns its output; of code 2, its error."""
    from stixel_cli.cli.app import main

    def told(*words, code=0):
        capsys.readouterr()
        found = main([*map(str, words)])
        output, error = capsys.readouterr()
        assert found == code, error
        return error if code == 2 else output

    return told


@pytest.fixture(scope="session", autouse=True)
def _nothing_of_the_user(shared_cache, tmp_path_factory):
    """Neither the user's cache nor `results` of this clone, for fixtures of any scope, too."""
    from short_runs import runs_with

    with pytest.MonkeyPatch.context() as patch, runs_with():
        patch.chdir(tmp_path_factory.mktemp("work"))
        patch.setenv("STIXEL_CACHE", str(shared_cache))
        yield


@pytest.fixture(scope="module", autouse=True)
def _runs_of_module(request):
    """For the module's fixtures, too."""
    from short_runs import marks_of, runs_with

    with runs_with(*marks_of(request.node)):
        yield


@pytest.fixture(autouse=True)
def _runs_of_test(request, _runs_of_module):
    from short_runs import marks_of, runs_with

    with runs_with(*marks_of(request.node)):
        yield


def pytest_collection_modifyitems(items):
    """The longest tests first: at the end, the other worker would wait for them."""
    long = ("bench", "filament", "tutorials", "tune", "result_folder", "sweep_failures")
    long += ("dask", "verdict", "mlflow_folder")
    items.sort(key=lambda item: item.path.stem.removeprefix("test_") not in long)
    items.sort(key=lambda item: item.path.name != "test_bench.py")
    gc.freeze()
