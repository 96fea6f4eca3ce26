"""What it takes to set up a scene: CPU time to build, render and match; lines of YAML."""

import dataclasses
import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.schema import Configuration
from stixel_cli.rendering.surfaces import build_surfaces
from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.statistics import over_seeds
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.world import world_objects
from stixel_cli.studies.data import StudyData, StudyRun
from stixel_cli.studies.rq1.errors import grid, matcher, rig, road_user

SCENE = ("road_user", "path", "ego", "rig", "world", "renderer", "sensor")
"""The groups of the configuration that describe a scene and its cameras."""


@dataclass(frozen=True)
class Building:
    """CPU seconds to build a scene's meshes and the surfaces that rays meet, and triangles."""

    cpu_seconds: float
    triangles: int


def timed_building(meshes: Callable[[], Iterable[Mesh]]) -> Building:
    """Build the meshes and their surfaces, and measure the CPU time, on one thread."""
    start = time.thread_time()
    made = list(meshes())
    build_surfaces([(1, mesh) for mesh in made])
    cpu_seconds = time.thread_time() - start
    return Building(cpu_seconds, sum(len(part.triangles) for mesh in made for part in mesh.parts))


def setup_values(data: StudyData) -> dict[str, Any]:
    """The template's values on setting up a scene.

    The time to build the meshes is measured here, on this machine.
    """
    runs = data.sweeps["ranges"].runs
    first = runs[0].configuration
    built = {"street": timed_building(lambda: [item.mesh for item in world_objects(first.world)])}
    users = {road_user(run): run.configuration.road_user for run in reversed(runs)}
    for label, user in reversed(users.items()):
        built[label] = timed_building(lambda user=user: road_user_meshes(user)[:1])
    rows = (
        {"what": what, "CPU seconds": one.cpu_seconds, "triangles": one.triangles}
        for what, one in built.items()
    )
    return {
        "street_seconds": built["street"].cpu_seconds,
        "render_seconds": cpu_seconds_a_frame(runs, "render"),
        "values_of_a_scene": values_of(first),
        "study_lines": lines_of(data.name),
        "building_table": Table.of("building", rows),
        "seconds_table": Table.of("seconds", _seconds(data)),
    }


def values_of(configuration: Configuration) -> int:
    """Number of values in the groups of the configuration that describe a scene."""

    def leaves(value) -> int:
        if dataclasses.is_dataclass(value):
            return sum(leaves(getattr(value, f.name)) for f in dataclasses.fields(value))
        return 1

    return sum(leaves(getattr(configuration, group)) for group in SCENE)


def cpu_seconds_a_frame(runs: Iterable[StudyRun], stage: str) -> float | None:
    """Mean recorded CPU seconds of a stage per frame; None if no run has any."""
    shares = (run.cpu_seconds.get(stage, math.nan) / len(run.scores.times) for run in runs)
    return over_seeds(shares).mean


def _seconds(data: StudyData) -> Iterator[dict[str, Cell]]:
    for name, label in (("rigs", rig), ("matchers", matcher), ("grids", grid)):
        runs = data.sweeps[name].runs if name in data.sweeps else ()
        for setting in dict.fromkeys(map(label, runs)):
            own = [run for run in runs if label(run) == setting]
            stages = ("render", "add_sensor_noise", "match", "free_space", "stixels")
            labels = ("render", "sensor noise", "match", "free space", "stixels")
            seconds = (cpu_seconds_a_frame(own, stage) for stage in stages)
            yield {"sweep": name, "setting": setting, **dict(zip(labels, seconds, strict=True))}


def lines_of(study: str) -> int:
    """Lines of a shipped study's file without comments and empty lines; 0 if it is not shipped."""
    path = shipped_folder("pipelines") / "studies" / f"{study}.yaml"
    if not path.is_file():
        return 0
    lines = (line.strip() for line in path.read_text(encoding="utf-8").splitlines())
    return sum(1 for line in lines if line and not line.startswith("#"))
