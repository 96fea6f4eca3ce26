"""Whole commands: cold, warm and changed runs, and a study; processor time and memory.

`pytest bench/bench_run.py -o python_files='bench_*.py'`. The figures are in the benchmark's
`extra_info` and printed at the end of each; the memory is the greatest sum over all processes of
the proportional set size, looked at every 0.3 s. Python keeps its bytecode, and the kernels are
compiled, as after `make setup` and a first run.
"""

import os
import subprocess
import sys
import tempfile
import threading
import time

import psutil
import pytest
from small import FOLDER, sized

from stixel_cli.cli.app import main

RUN = "`stixel run`, whole process"
STUDY = "`stixel study`, whole process"
SMALL = ("measurement=fabricated", "path.duration=0.1", "pictures.frames=[]", "executor=threads")
SIZE = sized((), SMALL)
FABRICATED = sized(("measurement=fabricated",), SMALL)
TINY_STUDY = ("study", "rq2", "road_user=car", "path=turn", "seed=range(0,2)")
TINY_STUDY += (
    f"measurement=fabricated{sized(',lidar', '')}",
    f"path.duration={sized(2, 0.2)}",
    "--name",
    "tiny",
    *sized((), ("--dry-run",)),
)


def process(cache, results, *arguments, watched=True):
    """Seconds to the first of stdout and to the end, CPU seconds and memory (MB) of a command.

    `watched`: whether its memory is; a look at it holds the command up.
    """
    environment = os.environ | {"STIXEL_CACHE": str(cache), "PYTHONUNBUFFERED": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = os.times()
    started = time.perf_counter()
    command = [sys.executable, "-m", "stixel_cli", *arguments, "--results", str(results)]
    pipe = subprocess.PIPE
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, env=environment, stdout=pipe, stderr=errors) as process,
    ):
        peak, ended = [0.0], threading.Event()
        watcher = threading.Thread(target=watch, args=(process.pid, peak, ended), daemon=True)
        if watched:
            watcher.start()
        # Progress is on stderr, so the scores are the first of stdout.
        process.stdout.read(1)
        scores = time.perf_counter() - started
        process.stdout.read()
        code, wall = process.wait(), time.perf_counter() - started
        errors.seek(0)
        assert code == 0, errors.read()
    # At once: the wait for a next look would be in the table that pytest-benchmark prints.
    ended.set()
    if watched:
        watcher.join()
    after = os.times()
    cpu = (after.children_user + after.children_system) - (
        before.children_user + before.children_system
    )
    return {
        "scores_s": scores,
        "wall_s": wall,
        "cpu_s": cpu,
        "cpu_per_wall": cpu / wall,
        "peak_mb": peak[0],
    }


def watch(pid: int, peak: list[float], ended: threading.Event) -> None:
    """Keep the greatest sum of the memory of a process and its descendants, MB, in `peak`."""
    while True:
        try:
            root = psutil.Process(pid)
            processes = [root, *root.children(recursive=True)]
        except psutil.NoSuchProcess:
            return
        total = 0.0
        for process in processes:
            try:
                total += process.memory_full_info().pss / 1e6
            except (psutil.NoSuchProcess, psutil.AccessDenied):
                continue
        peak[0] = max(peak[0], total)
        if ended.wait(0.3):
            return


def call(cache, results, *arguments, watched=True):
    """As `process`, in this process and without its memory: the command is what is tried."""
    started = time.perf_counter()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STIXEL_CACHE", str(cache))
        assert main([*arguments, "--results", str(results)]) == 0
    seconds = time.perf_counter() - started
    return {"scores_s": seconds, "wall_s": seconds, "cpu_s": seconds, "peak_mb": 0.0}


measured = sized(process, call)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A results folder and a cache that a default run has filled, and the record of that run."""
    results, cache = tmp_path_factory.mktemp("results"), tmp_path_factory.mktemp("cache")
    if not FOLDER:
        process(tmp_path_factory.mktemp("first"), results, "run", "measurement=fabricated")
    return results, cache, process(cache, results, "run", *SIZE, *sized((), ("--dry-run",)))


def measure(benchmark, group, run, rounds):
    """Record the round of median wall time of `run(watched)`, which returns what `process` does.

    The first round's memory is watched; of several, its time does not count.
    """
    benchmark.group = group
    records = []
    benchmark.pedantic(lambda: records.append(run(not records)), rounds=rounds, iterations=1)
    timed = sorted(records[1:] or records, key=lambda record: record["wall_s"])
    middle = timed[len(timed) // 2] | {"peak_mb": records[0]["peak_mb"]}
    benchmark.extra_info.update({name: round(value, 2) for name, value in middle.items()})
    print("\n", benchmark.extra_info)


def test_cold_default_run(benchmark, folders):
    """All computed; compiled kernels are there."""
    measure(benchmark, RUN, lambda _: folders[2], rounds=1)


def test_cold_run_with_a_moving_ego(benchmark, folders, tmp_path):
    run = ("run", *SIZE, "ego=straight")
    measure(benchmark, RUN, lambda _: measured(tmp_path, folders[0], *run), rounds=1)


def test_cold_fabricated_run(benchmark, folders, tmp_path_factory):
    measure(
        benchmark,
        RUN,
        lambda watched: measured(
            tmp_path_factory.mktemp("cold"), folders[0], "run", *FABRICATED, watched=watched
        ),
        rounds=4,
    )


def test_warm_default_run(benchmark, folders):
    results, cache, _ = folders
    measure(
        benchmark,
        RUN,
        lambda watched: measured(cache, results, "run", *SIZE, watched=watched),
        rounds=8,
    )


def test_changed_tracker_parameter(benchmark, folders):
    results, cache, _ = folders
    values = (f"tracker.sigma_q={1.5 + k / 100}" for k in range(1, 100))
    measure(
        benchmark,
        RUN,
        lambda watched: measured(cache, results, "run", *SIZE, next(values), watched=watched),
        rounds=8,
    )


@pytest.fixture(scope="module")
def study(folders, tmp_path_factory):
    """A folder for the cache and the results of a study that has been made, and its record."""
    folder = tmp_path_factory.mktemp("study")
    return folder, measured(folder, folder / "1", *TINY_STUDY)


def test_cold_tiny_study(benchmark, study):
    """Eight fabricated and lidar runs of two seconds, and the report."""
    measure(benchmark, STUDY, lambda _: study[1], rounds=1)


def test_report_again_from_the_cache(benchmark, study):
    folder, _ = study
    measure(
        benchmark,
        STUDY,
        lambda watched: measured(folder, folder / "1", *TINY_STUDY, watched=watched),
        rounds=4,
    )
