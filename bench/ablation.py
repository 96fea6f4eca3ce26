"""What a change of a tracker does at home and away, on tuning seeds: two minutes for 200 runs.

    STIXEL_DATA=DIR python bench/ablation.py tracker=contour tracker.iterations=1
    STIXEL_DATA=DIR python bench/ablation.py contour.contour_recovery:LARGEST=1e9

An argument is an override of the tracker, or a constant of a module below `stixel_cli.tracking`
with a number, but of `ray_kernels`, which is compiled; without them all terms are there. DIR has
the folders `pandaset` and `kitti0000_lidar`; without it only scenes of ours are tracked. The first
call measures the scans, which the cache keeps.
"""

import os
import sys
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from stixel_cli.config.compose import Composition, compose
from stixel_cli.engine.keys import Stage
from stixel_cli.experiment.stages import computed_stages, pipeline_stages
from stixel_cli.studies.report import shipped_meshes

CLASSES, PATHS, SEEDS = (
    ("car", "cyclist", "pedestrian"),
    ("turn", "crossing", "approach"),
    (1020, 1021),
)
POSES = ("yaw_deg=1.0", "late_s=0.1", "range_m=0.25", "drift_m_s=0.05")
METRICS = ("iou_box_mean", "track_lost", "nees_position_mean", "nis_mean", "band_coverage")
METRICS += ("sure_and_wrong_share", "other_probability")

Case = tuple[str, tuple[str, ...]]


def cases() -> Iterator[Case]:
    """Each row's name and the overrides of one of its runs, without the tracker's."""
    seeded = [(f"seed={seed}", f"road_user.shape_seed={seed}") for seed in SEEDS]
    for measurement, name, path, seed in product(
        ("stixels", "fabricated", "lidar", "lidar_64"), CLASSES, PATHS, seeded
    ):
        own = f"measurement={measurement}", f"road_user={name}", f"path={path}"
        yield f"home {measurement} {name}", (*own, *seed)
    constant = "measurement=fabricated", "measurement/noise=constant"
    plain = *constant, "measurement.noise.range_std=0.1"
    for kind, measured in (("shapes", plain), ("odd", ("measurement=lidar_64",))):
        for axis in shipped_meshes(kind):
            for values, path in product(zip(*axis.values(), strict=True), PATHS):
                own = tuple(f"{key}={one}" for key, one in zip(axis, values, strict=True))
                yield (
                    f"{kind} {Path(values[-1]).stem}",
                    (*measured, *own, f"path={path}", "seed=1000"),
                )
    for name, occluder, path, seed in product(CLASSES, ("parked_car", "hedge"), PATHS[:2], seeded):
        own = f"road_user={name}", f"world.occluder={occluder}", f"path={path}"
        yield (
            f"hidden {name}",
            ("measurement=lidar_64", *own, *seed, seed[0].replace("seed", "world.seed")),
        )
    wrong = "start.position=1.0", "start.heading=0.5", "start.velocity=2.0"
    gap = ("measurement.dropout=[1.5,3.5]",)
    for (kind, other), name, path, seed in product(
        (("start", wrong), ("gap", gap)), CLASSES, PATHS, seeded
    ):
        yield f"{kind} {name}", (f"road_user={name}", f"path={path}", *other, *seed)
    for seed in seeded:
        ahead = "path=depart", "ego=straight", "ego.speed=5", "rig=kitti"
        yield "ahead car", ("road_user=car", *ahead, *seed)
    for error, seed in product(POSES, seeded):
        own = "measurement=stixel_cli.studies.wrong_poses:wrong_poses", f"measurement.{error}"
        followed = "road_user=car", "path=depart", "ego=straight", "ego.speed=5"
        yield f"poses {error}", (*own, *followed, *seed)
    for name in ("pandaset", "kitti0000_lidar"):
        for file in sorted(Path(os.environ.get("STIXEL_DATA", "")).glob(f"{name}/*/scans.csv")):
            yield from recorded(file.parent)


def recorded(folder: Path) -> Iterator[Case]:
    """Both seeds of a recording's start."""
    name = folder.name.partition("-")[0]
    files = [
        f"measurement.{k}={folder / f}.csv"
        for k, f in (("path", "scans"), ("ego", "ego"), ("truth", "truth"))
    ]
    for seed in SEEDS:
        known = f"road_user={name if name in CLASSES else 'car'}", "measurement.range_std=0.1"
        yield f"{folder.parent.name} {name}", ("measurement=file", *files, *known, f"seed={seed}")


def inputs(composition: Composition) -> dict[str, Any]:
    """What the stages `track` and `scores` need, by the name of its node."""
    stages = {one.name: one for one in pipeline_stages(composition)}
    names = {*stages["track"].inputs.values(), *stages["scores"].inputs.values()} - {"track"}
    with computed_stages(composition, sorted(names)) as (_, load):
        return {name: load(name)[0] for name in names}


def called(stage: Stage, nodes: dict[str, Any]) -> Any:
    """The result of a stage in this process."""
    module, _, name = stage.function.partition(":")
    seed = {} if stage.seed is None else {"seed": stage.seed}
    arguments = {argument: nodes[node] for argument, node in stage.inputs.items()}
    return getattr(import_module(module), name)(**arguments, **stage.settings, **seed)


def row(job: tuple[str, tuple[str, ...], tuple[str, ...]]) -> dict[str, Any]:
    """The metrics of one run, and its time a scan, ms."""
    label, overrides, tracker = job
    composition = compose((*overrides, *tracker, "executor.workers=1"))
    nodes, stages = inputs(composition), {one.name: one for one in pipeline_stages(composition)}
    with warnings.catch_warnings(), threadpool_limits(1):
        warnings.simplefilter("ignore")
        began = time.process_time()
        nodes["track"] = called(stages["track"], nodes)
        took = 1e3 * (time.process_time() - began) / len(nodes["scans"])
        metrics = called(stages["scores"], nodes).metrics
    return {"row": label, **{name: metrics.get(name) for name in METRICS}, "ms": took}


def set_constant(text: str) -> None:
    """Set `MODULE:NAME=NUMBER` in every module that has imported it."""
    place, _, number = text.partition("=")
    module, _, name = place.partition(":")
    before = getattr(import_module(f"stixel_cli.tracking.{module}"), name)
    for one in [one for key, one in sys.modules.items() if key.startswith("stixel_cli.")]:
        if getattr(one, name, None) is before:
            setattr(one, name, float(number))


def main(arguments: list[str]) -> None:
    """Print the means of each row, of home and of away."""
    for kind in ("contour.contour", "gp_ekf"):
        import_module(f"stixel_cli.tracking.{kind}")
    # The processes of the pool are forks of this one.
    tracker = [one for one in arguments if ":" not in one.partition("=")[0]]
    for one in arguments:
        if one not in tracker:
            set_constant(one)
    chosen = tuple(
        tracker
        if any(one.startswith("tracker=") for one in tracker)
        else ["tracker=contour", *tracker]
    )
    jobs = [(label, overrides, chosen) for label, overrides in cases()]
    with ProcessPoolExecutor(2, get_context("fork")) as pool:
        frame = pd.DataFrame(pool.map(row, jobs, chunksize=4))
    frame[list(METRICS)] = frame[list(METRICS)].astype(float)
    place = np.where(frame["row"].str.startswith("home"), "HOME", "AWAY")
    for by in ("row", place):
        print(frame.groupby(by, sort=False)[[*METRICS, "ms"]].mean().round(3).to_string())


if __name__ == "__main__":
    main(sys.argv[1:])
