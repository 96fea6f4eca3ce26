"""The computational cost of a simulated scan (rendering to stixels) and of a fabricated scan.

The thesis states a ratio of more than 60. The measured ratio is in the benchmark's `extra_info`.
Both scans are of the default configuration. Ten frames of the simulated scan share the static
background, as in a run.
"""

import time
from dataclasses import replace
from pkgutil import resolve_name

import pytest
from small import IMAGES, sized

from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import pipeline_stages

FRAMES = sized(range(30, 40), range(2))


def call(stages, name, **inputs):
    """The result of a stage's function, called as the engine does."""
    stage = stages[name]
    seed = {} if stage.seed is None else {"seed": stage.seed}
    return resolve_name(stage.function)(**inputs, **stage.settings, **seed)


@pytest.fixture(scope="module")
def simulated():
    stages = {stage.name: stage for stage in pipeline_stages(compose(IMAGES))}
    ego_motion = call(stages, "ego_motion")
    scenario = call(stages, "scenario", ego_motion=ego_motion)

    def scans():
        frames = {"frames": FRAMES}
        rendered = call(stages, "render", scenario=scenario, **frames)
        pairs = call(stages, "add_sensor_noise", rendered=rendered, **frames)
        disparities = call(stages, "match", pairs=pairs, **frames)
        free_space = call(
            stages,
            "free_space",
            disparities=disparities,
            ego_motion=ego_motion,
            previous=None,
            **frames,
        )
        given = {"pairs": pairs, "disparities": disparities, "free_space": free_space}
        return call(stages, "stixels", **given, **frames)

    return scenario, scans


def test_fabricated_scan_against_a_simulated_one(benchmark, simulated):
    scenario, simulate = simulated
    composition = compose(["measurement=fabricated", *IMAGES])
    stages = {stage.name: stage for stage in pipeline_stages(composition)}
    few = replace(
        scenario,
        **{
            name: getattr(scenario, name)[FRAMES.start : FRAMES.stop]
            for name in ("times", "ego_poses_world", "target_poses_world", "target_rates_world")
        },
    )
    simulate()
    started = time.perf_counter()
    simulate()
    a_simulated_scan = (time.perf_counter() - started) / len(FRAMES)
    benchmark(lambda: call(stages, "scans", scenario=few))
    a_fabricated_scan = benchmark.stats.stats.median / len(FRAMES)
    benchmark.extra_info.update(
        simulated_ms=round(1e3 * a_simulated_scan, 1),
        fabricated_ms=round(1e3 * a_fabricated_scan, 4),
        ratio=round(a_simulated_scan / a_fabricated_scan),
    )
    print("\n", benchmark.extra_info)
