"""Overhead of a sweep: planning 1,000 runs (goal 3 s), 200 tracker runs (60 s).

pytest bench/bench_sweep.py
"""

import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from small import sized

from stixel_cli.border.origins import TYPED
from stixel_cli.cli.sweep import sweep as sweep_command
from stixel_cli.config.compose import Composer, compose
from stixel_cli.config.overrides import read_overrides
from stixel_cli.engine.store import Store
from stixel_cli.sweeps.design import sweep_design
from stixel_cli.sweeps.graphs import plan_sweep
from stixel_cli.sweeps.run import new_sweep

RUNS, TRACKER_RUNS = sized((1000, 200), (10, 3))
SETTINGS = f"tracker.sigma_q=range(0.1,{TRACKER_RUNS / 10 + 0.1:.1f},0.1)"
FABRICATED = ["measurement=fabricated", *sized([], ["path.duration=1", "executor=threads"])]
LINES = {
    "100 settings × 10 seeds, simulated": [
        f"tracker.sigma_q=range(1,{RUNS // 10 + 1})",
        "seed=range(10)",
    ],
    "1,000 settings, simulated": [f"tracker.sigma_q=range(0.1,{RUNS // 10}.1,0.1)"],
    "1,000 seeds, fabricated": ["measurement=fabricated", f"seed=range({RUNS})"],
}
GROUPS = [
    "road_user=glob(*)",
    "path=glob(*,exclude=recorded)",
    "ego=glob(*)",
    "rig=glob(*)",
    "stereo=glob(*)",
][sized(0, 3) :]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    return Store(tmp_path / "cache")


@pytest.mark.benchmark(group="plan of 1,000 runs, all cached")
@pytest.mark.parametrize("line", LINES)
def test_plan(benchmark, cache, capsys, line):
    """`stixel sweep --dry-run` without the start of the process."""
    plan = plan_sweep(sweep_design(LINES[line]))
    for key in plan.needed:
        cache.save(key, None)
    assert len(plan.runs) == RUNS
    benchmark.pedantic(sweep_command, args=(LINES[line],), kwargs={"dry_run": True}, rounds=3)
    benchmark.extra_info["nodes"] = len(plan.needed)
    assert f"{RUNS} runs, {RUNS} complete" in capsys.readouterr().out


@pytest.mark.benchmark(group="200 configurations")
@pytest.mark.parametrize("how", ["compose", "Composer"])
@pytest.mark.parametrize("what", ["keys", "groups"])
def test_compose(benchmark, how, what):
    """With a composer per configuration, and with one for all."""
    line = [SETTINGS] if what == "keys" else GROUPS
    texts = [run.overrides for run in plan_sweep(sweep_design(line)).runs][:TRACKER_RUNS]

    def run(composer):
        if composer is None:
            return [compose(line) for line in texts]
        return [composer.compose(read_overrides(line, TYPED)) for line in texts]

    setup = Composer if how == "Composer" else lambda: None
    benchmark.pedantic(run, setup=lambda: ((setup(),), {}), rounds=1)


@pytest.mark.benchmark(group="200 tracker runs on cached measurements")
@pytest.mark.parametrize("how", ["plain calls", "sweep"])
def test_tracker_runs(benchmark, cache, tmp_path, how):
    """100 scans each, two workers; compared with plain calls in one process without a store."""
    line = [*FABRICATED, SETTINGS]
    made = new_sweep(plan_sweep(sweep_design([*FABRICATED, "tracker.sigma_q=30,31"])))
    assert made.complete
    plan = plan_sweep(sweep_design(line))
    assert {stage["name"] for stage in plan.stages if stage["to_run"]} == {"track", "scores"}
    if how == "sweep":
        result = benchmark.pedantic(
            lambda: new_sweep(plan_sweep(sweep_design(line)), tmp_path / "results"), rounds=1
        )
        assert result.computed == 2 * TRACKER_RUNS
        return
    from stixel_cli.engine.limits import one_thread
    from stixel_cli.evaluation.evaluate import evaluate
    from stixel_cli.tracking.gp_ekf import track

    graph = plan.runs[0].graph
    given = SimpleNamespace(
        **{name: cache.load(graph.of_stage(name)[0].key) for name in ("scans", "start", "scenario")}
    )

    def calls():
        with one_thread():
            for planned in plan.runs:
                configuration = planned.composition.configuration
                found = track(given.scans, given.start, configuration.prior, configuration.tracker)
                evaluate(found, given.scenario, given.scans)

    benchmark.pedantic(calls, rounds=1)


@pytest.mark.benchmark(group="scores of a track of contour, 100 scans")
@pytest.mark.parametrize("how", ["shapely, IoU and distances of outlines", "evaluate, all scores"])
def test_scores(benchmark, cache, how):
    """The reference computes only two of the scores, scan by scan."""
    import shapely

    from stixel_cli.engine.limits import one_thread
    from stixel_cli.evaluation.evaluate import evaluate

    line = [*FABRICATED, "tracker=contour", "seed=0,1"]
    assert new_sweep(plan_sweep(sweep_design(line))).complete
    graph = plan_sweep(sweep_design(line)).runs[0].graph
    track, scenario, scans, scores = (
        cache.load(graph.of_stage(name)[0].key) for name in ("track", "scenario", "scans", "scores")
    )

    def plain():
        ious, farthest = [], []
        for contours in zip(track.contours_world, scenario.contours_world, strict=True):
            one, other = map(shapely.Polygon, contours)
            common = one.intersection(other).area
            ious.append(common / (one.area + other.area - common))
            for points, outline in ((one, other), (other, one)):
                along = np.arange(72) / 72
                on = shapely.line_interpolate_point(points.exterior, along, normalized=True)
                farthest.append(shapely.distance(on, outline.exterior).max())
        return np.mean(ious), np.maximum(farthest[::2], farthest[1::2]).mean()

    with one_thread():
        if how == "evaluate, all scores":
            metrics = benchmark(evaluate, track, scenario, scans).metrics
            assert metrics["iou_mean"] == scores.metrics["iou_mean"]
        else:
            expected = scores.metrics["iou_mean"], scores.metrics["hausdorff_m"]
            assert benchmark(plain) == pytest.approx(expected, rel=1e-9)


def test_the_whole_process(tmp_path, cache):
    """`stixel sweep --dry-run` of 1,000 cached runs as one types it; printed, not asserted."""
    import subprocess

    line = LINES["1,000 settings, simulated"]
    plan = plan_sweep(sweep_design(line))
    for key in plan.needed:
        cache.save(key, None)
    started = time.perf_counter()
    words = ("-m", "stixel_cli", "sweep", "--dry-run", *line)
    command = [sys.executable, *sized(words, ("-c", ""))]
    subprocess.run(command, check=True, capture_output=True)
    print(f"\nstixel sweep --dry-run, whole process: {time.perf_counter() - started:.2f} s")
