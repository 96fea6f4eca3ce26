"""What it takes to set up a scene: CPU time to build, render and match; lines of YAML."""

import dataclasses
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.schema import Configuration
from stixel_cli.rendering.surfaces import build_surfaces
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.world import world_objects
from stixel_cli.studies.data import StudyData, StudyRun, StudySweep
from stixel_cli.studies.rq1.pool import by_label, cell, grid, matcher, rig, road_user
from stixel_cli.studies.types import Table

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
    street = timed_building(lambda: [item.mesh for item in world_objects(first.world)])
    rows = [("street", cell(street.cpu_seconds), street.triangles)]
    for label, users in by_label(runs, road_user).items():
        user = users[0].configuration.road_user
        built = timed_building(lambda user=user: road_user_meshes(user)[:1])
        rows.append((label, cell(built.cpu_seconds), built.triangles))
    columns = ("sweep", "setting", "render", "sensor noise", "match", "free space", "stixels")
    return {
        "street_seconds": street.cpu_seconds,
        "render_seconds": cell(cpu_seconds_a_frame(runs, "render")),
        "values_of_a_scene": values_of(first),
        "study_lines": lines_of(data.name),
        "building_table": Table("building", "", ("what", "CPU seconds", "triangles"), tuple(rows)),
        "seconds_table": Table("seconds", "", columns, tuple(_seconds(data))),
    }


def values_of(configuration: Configuration) -> int:
    """Number of values in the groups of the configuration that describe a scene."""

    def leaves(value) -> int:
        if dataclasses.is_dataclass(value):
            return sum(leaves(getattr(value, f.name)) for f in dataclasses.fields(value))
        return 1

    return sum(leaves(getattr(configuration, group)) for group in SCENE)


def cpu_seconds_a_frame(runs: Iterable[StudyRun], stage: str) -> float:
    """Mean recorded CPU seconds of a stage per frame; NaN if no run has any."""
    shares = [run.cpu_seconds.get(stage, math.nan) / len(run.scores.times) for run in runs]
    shares = [share for share in shares if math.isfinite(share)]
    return sum(shares) / len(shares) if shares else math.nan


def _seconds(data: StudyData):
    named = {"rigs": rig, "matchers": matcher, "grids": grid}
    for name, label in named.items():
        sweep: StudySweep | None = data.sweeps.get(name)
        for setting, runs in by_label(sweep.runs if sweep else (), label).items():
            stages = ("render", "add_sensor_noise", "match", "free_space", "stixels")
            yield (name, setting, *(cell(cpu_seconds_a_frame(runs, stage)) for stage in stages))


def lines_of(study: str) -> int:
    """Lines of a shipped study's file without comments and empty lines; 0 if it is not shipped."""
    path = shipped_folder("pipelines") / "studies" / f"{study}.yaml"
    if not path.is_file():
        return 0
    lines = (line.strip() for line in path.read_text(encoding="utf-8").splitlines())
    return sum(1 for line in lines if line and not line.startswith("#"))
