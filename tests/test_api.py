"""`from stixel_cli import compose, load, plot, run, sweep`: as from a notebook."""

import inspect
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from short_runs import short_python

import stixel_cli
from stixel_cli import compose, load, plot, run, sweep
from stixel_cli.config.compose import from_resolved
from stixel_cli.config.texts import mapping_texts
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.folder import SweepResult
from stixel_cli.tracking.baselines import point

FABRICATED = ["measurement=fabricated", "path.duration=0.5", "pictures.frames=[0]"]


def test_the_package_imports_its_version_only():
    program = (
        "import sys; before = set(sys.modules); import stixel_cli; "
        "sys.exit(sorted(set(sys.modules) - before - {'stixel_cli', 'stixel_cli.version'}) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with pytest.raises(AttributeError, match="no attribute 'walk'"):
        stixel_cli.walk  # noqa: B018
    assert {"compose", "load", "plot", "run", "sweep"} <= set(stixel_cli.__all__)
    assert dir(stixel_cli) == sorted(stixel_cli.__all__)
    for name in stixel_cli.__all__:
        assert getattr(stixel_cli, name)


def test_the_public_functions_are_annotated():
    """`py.typed` promises it to type checkers."""
    assert (Path(stixel_cli.__file__).parent / "py.typed").exists()
    shown = [getattr(stixel_cli, name) for name in stixel_cli.__all__ if name != "__version__"]
    functions = [one for one in shown if inspect.isfunction(one)]
    classes = {one for one in shown if inspect.isclass(one)}
    for kind in {*classes, stixel_cli.trackers.Contour, RunResult, SweepResult}:
        own = [one for name, one in vars(kind).items() if name.strip("_") == name]
        functions += [one for one in own if inspect.isfunction(one)]
    for function in functions:
        signature = inspect.signature(function)
        assert signature.return_annotation is not signature.empty, function
        for name, parameter in signature.parameters.items():
            assert name == "self" or parameter.annotation is not parameter.empty, function


def test_run_gives_nouns_records_and_tables(tmp_path):
    result = run([*FABRICATED, "tracker.sigma_f=0.5"])
    assert result.folder is None
    assert result.metrics["scans"] == 5
    assert result.record["tracker.sigma_f"] == 0.5
    assert result.record["measurement"] == "fabricated"
    assert result.record["seed"] == 0
    assert result.record["centre_rmse_m"] == result.metrics["centre_rmse_m"]
    json.dumps(result.record)
    for table in result.tables.values():
        assert len({len(column) for column in table.values()}) == 1
    assert np.array_equal(result.tables["track"]["x"], result.track.means[:, 0])
    assert os.listdir(tmp_path) == []


def test_a_result_folder_is_as_that_of_the_command_line(tmp_path):
    result = run(FABRICATED, results=tmp_path, name="mine")
    assert result.folder == tmp_path / "mine"
    assert json.loads((tmp_path / "mine" / "metrics.json").read_text()) == result.metrics
    assert "stixel run measurement=fabricated" in (tmp_path / "mine" / "manifest.json").read_text()
    with pytest.raises(UserError, match="exists; choose another --name"):
        run(FABRICATED, results=str(tmp_path), name="mine")


def test_calls_leave_nothing_behind(tmp_path):
    """The same call gives the same, whatever was called, and failed, between."""
    environment, folder = dict(os.environ), os.getcwd()
    first = run(FABRICATED)
    for wrong in (["rig.widht=3"], ["seed=0,1"], "seed", ["rig=kitti", "rig=kitti"]):
        with pytest.raises(ConfigurationError):
            compose(wrong)
    other = run([*FABRICATED, "seed=1"], cache=tmp_path / "cache", workers=1)
    again = run(compose(FABRICATED))
    assert again.metrics == first.metrics != other.metrics
    assert {stage["status"] for stage in again.stages} == {"cached"}
    assert {stage["status"] for stage in other.stages} == {"computed"}
    assert (dict(os.environ), os.getcwd()) == (environment, folder)


def test_threads_may_call_at_once():
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(3) as threads:
        results = list(threads.map(lambda seed: run([*FABRICATED, f"seed={seed}"]), (0, 0, 1)))
    assert results[0].metrics == results[1].metrics != results[2].metrics


def test_a_composition_says_what_it_is_and_later_overrides_win_only_if_asked_for():
    composition = compose("rig=kitti")
    assert composition.choices["rig"] == "kitti"
    assert compose().configuration.seed == 0
    with pytest.raises(ConfigurationError, match=r"executor\.workers"):
        run(FABRICATED, workers=0)
    base = ["measurement=fabricated", "seed=1"]
    with pytest.raises(ConfigurationError, match="given twice"):
        compose(base, "seed=2")
    composition = compose(base, "seed=2", ["rig=kitti"], last_wins=True)
    assert composition.overrides == ("measurement=fabricated", "seed=2", "rig=kitti")
    assert compose(base, "rig=kitti").choices["rig"] == "kitti"
    with pytest.raises(UserError, match="one composition"):
        run(composition, "seed=3")


def test_a_composition_keeps_its_settings_on_another_number_of_workers(tmp_path):
    """Composed again it would have the defaults of today, and look for files elsewhere."""
    composition = compose("measurement=fabricated", "path.duration=0.3", "executor=threads")
    length = composition.resolved["prior"] | {"length": 4.4}
    resolved = composition.resolved | {"prior": length}
    changed = replace(composition, resolved=resolved, configuration=from_resolved(resolved))
    result = run(changed, workers=1, cache=tmp_path / "cache", results=tmp_path / "results")
    used = result.configuration
    assert (used.prior.length, used.executor.workers) == (4.4, 1)
    assert used.cache.folder == str(tmp_path / "cache")


def test_a_sweep_gives_a_record_a_point(tmp_path):
    result = sweep([*FABRICATED, "tracker.sigma_f=0.1,0.2"], cache=tmp_path / "cache", workers=1)
    assert result.complete
    assert result.folder is None
    assert len(result.records) == 2
    assert os.listdir(tmp_path) == ["cache"]
    alone = run([*FABRICATED, "tracker.sigma_f=0.2"])
    assert [one["tracker.sigma_f"] for one in result.records] == [0.1, 0.2]
    assert result.records[1]["tracker.sigma_f"] == alone.record["tracker.sigma_f"]
    assert result.records[1]["centre_rmse_m"] == alone.metrics["centre_rmse_m"]
    with pytest.raises(UserError):
        sweep([*FABRICATED, "tracker.sigma_f=0.1,wide"])
    table = result.frame()
    assert list(table["tracker.sigma_f"]) == [0.1, 0.2] and table.shape[0] == 2
    assert "tracker.sigma_f" in result._repr_html_()
    assert len(repr(result)) < 200 and "2 of 2 runs done" in repr(result)


@pytest.mark.sketched
def test_a_result_is_short_in_a_terminal_and_a_picture_in_a_notebook():
    result = run(FABRICATED, "seed=1")
    assert len(repr(result)) < 200
    for nouns in (result.scenario, result.scans, result.track, result.scores, result.composition):
        assert "\n" not in repr(nouns) and len(repr(nouns)) < 900
    assert "points_world (" in repr(result.scans)
    assert "car turn fabricated gp_ekf seed 1: " in repr(result)
    html = result._repr_html_()
    assert "data:image/png;base64," in html and "IoU of the outline, mean" in html
    assert "IoU 0." in html and "uncertainty: " in html
    assert "<img" not in replace(result, pictures={})._repr_html_()


def test_a_run_is_drawn_from_above_also_into_axes():
    figure = plot(run(FABRICATED))
    assert figure.axes[0].get_xlabel() == "x in the world (m)"
    with pytest.raises(UserError, match="no track"):
        plot(replace(run(FABRICATED), track=None))
    result = run(FABRICATED)
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.plot(ax=left) is figure
    assert plot(result, ax=right) is figure
    assert len(figure.axes) == 2 and len(left.lines) == len(right.lines) > 2


def test_overrides_are_texts_mappings_or_keywords():
    texts = ("measurement=fabricated", "path.duration=0.5", "pictures.frames=[0]", "seed=3")
    given = {"measurement": "fabricated", "path": {"duration": 0.5}, "pictures.frames": [0]}
    assert compose(given, seed=3).overrides == texts == compose(*texts).overrides
    assert compose(given, texts, seed=3, last_wins=True).overrides == texts
    folder = Path("my cache").absolute()
    assert compose(cache={"folder": folder}).configuration.cache.folder == str(folder)
    with pytest.raises(ConfigurationError, match=r"seeed: .*did you mean seed"):
        compose(seeed=3)
    with pytest.raises(UserError, match="one composition"):
        run(compose(given), seed=3)
    swept = sweep(given, {"tracker.sigma_f": (0.1, 0.2)}, seed=range(2, 4))
    assert [(r["tracker.sigma_f"], r["seed"]) for r in swept.records] == [
        *((0.1, 2), (0.1, 3), (0.2, 2), (0.2, 3))
    ]
    with pytest.raises(UserError) as told:
        run("tracker=contour seed=3")
    assert "several overrides" in str(told.value)
    assert "\n" not in str(told.value) and "tracker=contour" in str(told.value)


@pytest.mark.parametrize(
    "settings", [("road_user=cyclist",), ("tracker=contour", "tracker.lag=2", "prior=unknown")]
)
@pytest.mark.sketched
def test_a_folder_is_loaded_as_the_run_that_wrote_it(tmp_path, settings):
    fresh = run([*FABRICATED, *settings], results=tmp_path, name="mine")
    stored = load(str(tmp_path / "mine"))
    assert repr(stored) == repr(fresh)
    for name, table in fresh.arrays.items():
        assert table.keys() == stored.arrays[name].keys()
        for column, values in table.items():
            assert np.array_equal(values, stored.arrays[name][column], equal_nan=True), column
    assert stored.configuration == fresh.configuration
    assert np.array_equal(stored.scenario.contours_world, fresh.scenario.contours_world)
    assert np.array_equal(stored.plot().axes[1].get_xlim(), fresh.plot().axes[1].get_xlim())
    assert "data:image/png;base64," in stored._repr_html_()
    (tmp_path / "mine" / "track.npz").unlink()
    with pytest.raises(UserError, match=r"track\.npz"):
        load(tmp_path / "mine")
    with np.load(tmp_path / "mine" / "ego.npz") as ego:
        tables = dict(ego)
    for table, missing in (({"t": tables["t"]}, "x"), ({}, "t")):
        np.savez(tmp_path / "mine" / "ego.npz", **table)
        with pytest.raises(UserError, match=rf"ego\.npz: the column {missing} is missing"):
            load(tmp_path / "mine")


SCRIPT = """
import math
from dataclasses import dataclass

import numpy as np

from stixel_cli import run, sweep
from stixel_cli.engine.loaded_code import function_name
from stixel_cli.errors import ConfigurationError
from stixel_cli.tracking.track import Track

HALF = 0.5 * math.pi
scans = object()  # also an argument of `still`, which must not look for it here


def corners(size):
    return size * np.array([[math.cos(HALF * i), math.sin(HALF * i)] for i in range(4)])


@dataclass(frozen=True)
class Size:
    size: float = 1.0


def still(scans, initial, prior, tracker: Size):
    count = len(scans)
    contours = np.tile(initial.mean[:2] + corners(tracker.size), (count, 1, 1))
    return Track.of_scans(
        scans.times,
        (np.tile(initial.mean, (count, 1)), np.tile(np.eye(6), (count, 1, 1))),
        (contours, np.ones((count, 4))),
        [np.zeros(0, int)] * count,
        np.full(count, np.nan),
    )


def unusable():
    return scans


if __name__ == "__main__":
    base = {"measurement": "fabricated", "path.duration": 0.3, "pictures.frames": []}
    base["executor.workers"] = 1  # a process of its own
    result = run(base, {"tracker.size": 2.0}, tracker=still, results="results", name="still")
    print(np.ptp(result.track.contours_world[0, :, 0]))
    swept = sweep(base, tracker=(still, "point"))
    print([record["tracker"].partition("_")[0] for record in swept.records])
    for wrong in (lambda scans: None, unusable):
        try:
            function_name(wrong)
        except ConfigurationError as fault:
            print(fault)
"""


def test_a_tracker_may_be_a_function_of_a_script_notebook_or_module(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT, encoding="utf-8")
    environment = os.environ | {"STIXEL_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(
        short_python("script.py", "workers"),
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    size, trackers, lambda_fault, object_fault = done.stdout.splitlines()
    assert float(size) == pytest.approx(4.0)
    assert trackers == "['still', 'point']"
    assert lambda_fault.startswith("<lambda>: must be a function with a name")
    assert object_fault.startswith("scans: is a object")
    (source,) = (tmp_path / "results/still/code").glob("still_*.py")
    assert "def corners" in source.read_text() and "unusable" not in source.read_text()
    assert {path.name for path in (tmp_path / "cache/cells").glob("still_*.py")} == {source.name}
    assert mapping_texts({"tracker": point.track}) == [
        "tracker=stixel_cli.tracking.baselines.point:track"
    ]
    assert mapping_texts({"metrics": [point.track]})[0].startswith("metrics=[stixel_cli.")
