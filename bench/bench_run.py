"""The whole process: a cold, a warm and a changed run; processor time and memory of all processes.

`pytest bench/bench_run.py -o python_files='bench_*.py'`. The figures are in the benchmark's
`extra_info` and printed at the end of each; the memory is the greatest sum over all processes of
the proportional set size, looked at every 0.1 s.
"""

import os
import subprocess
import sys
import threading
import time

import psutil
import pytest


def stixel_run(cache, results, *overrides):
    """Seconds to the scores on the screen and to the end, CPU seconds and memory (MB) of a run."""
    environment = os.environ | {"STIXEL_CACHE": str(cache), "PYTHONUNBUFFERED": "1"}
    before = os.times()
    started = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "stixel_cli", "run", "--results", str(results), *overrides],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    peak = [0.0]
    watcher = threading.Thread(target=watch, args=(process.pid, peak), daemon=True)
    watcher.start()
    # Progress is on stderr, so the scores are the first of stdout.
    process.stdout.read(1)
    scores = time.perf_counter() - started
    process.stdout.read()
    assert process.wait() == 0
    wall = time.perf_counter() - started
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


def watch(pid: int, peak: list[float]) -> None:
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
        if root.status() == psutil.STATUS_ZOMBIE:
            return
        time.sleep(0.1)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A results folder and a cache that a default run has filled."""
    results, cache = tmp_path_factory.mktemp("results"), tmp_path_factory.mktemp("cache")
    stixel_run(cache, results)
    return results, cache


def measure(benchmark, run, rounds):
    benchmark.group = "`stixel run`, whole process"
    records = []
    benchmark.pedantic(lambda: records.append(run()), rounds=rounds, iterations=1)
    middle = sorted(records, key=lambda record: record["wall_s"])[len(records) // 2]
    benchmark.extra_info.update({name: round(value, 2) for name, value in middle.items()})
    print("\n", benchmark.extra_info)


def test_cold_default_run(benchmark, folders, tmp_path_factory):
    """All computed; compiled kernels are there."""
    results, _ = folders
    measure(benchmark, lambda: stixel_run(tmp_path_factory.mktemp("cold"), results), rounds=3)


def test_cold_run_with_a_moving_ego(benchmark, folders, tmp_path_factory):
    results, _ = folders
    measure(
        benchmark,
        lambda: stixel_run(tmp_path_factory.mktemp("cold"), results, "ego=straight"),
        rounds=1,
    )


def test_cold_fabricated_run(benchmark, folders, tmp_path_factory):
    results, _ = folders
    measure(
        benchmark,
        lambda: stixel_run(tmp_path_factory.mktemp("cold"), results, "measurement=fabricated"),
        rounds=3,
    )


def test_warm_default_run(benchmark, folders):
    results, cache = folders
    measure(benchmark, lambda: stixel_run(cache, results), rounds=5)


def test_changed_tracker_parameter(benchmark, folders):
    results, cache = folders
    values = iter(range(100))
    measure(
        benchmark,
        lambda: stixel_run(cache, results, f"tracker.sigma_q={1.5 + next(values) / 100}"),
        rounds=5,
    )
