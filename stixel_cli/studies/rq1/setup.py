"""What it takes to set up a scene: CPU time to build, render and match; lines of YAML."""

import dataclasses
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.schema import Configuration
from stixel_cli.rendering.surfaces import build_surfaces
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.road_user import road_user_mesh
from stixel_cli.scene.world import world_objects
from stixel_cli.studies.rq1.pool import by_label, cell, grid, matcher, rig, road_user, text
from stixel_cli.studies.types import Paragraph, Section, StudyData, StudyRun, StudySweep, Table

SCENE = ("road_user", "path", "ego", "rig", "world", "renderer", "sensor")
"""The groups of the configuration that describe a scene and its cameras."""


@dataclass(frozen=True)
class Building:
    """CPU seconds to build a scene's meshes and the surfaces that rays meet, and triangles."""

    cpu_seconds: float
    triangles: int


def timed_building(meshes: Callable[[], Iterable[Mesh]]) -> Building:
    """Build the meshes and their surfaces, and take the CPU time, on one thread."""
    start = time.thread_time()
    made = list(meshes())
    build_surfaces([(1, mesh) for mesh in made])
    cpu_seconds = time.thread_time() - start
    return Building(cpu_seconds, sum(len(part.triangles) for mesh in made for part in mesh.parts))


def setup_section(data: StudyData) -> Section:
    """The chapter; its building costs are measured while the report is made, on its machine."""
    points = data.sweeps["ranges"].runs
    first = points[0].configuration
    rows = []
    street = timed_building(lambda: [item.mesh for item in world_objects(first.world)])
    rows.append(("street", cell(street.cpu_seconds), street.triangles))
    for label, users in by_label(points, road_user).items():
        user = users[0].configuration.road_user
        built = timed_building(lambda user=user: [road_user_mesh(user)])
        rows.append((label, cell(built.cpu_seconds), built.triangles))
    lines, own = lines_of(data.name), values_of(first)
    return Section(
        "What it takes to set up a scene",
        (
            Paragraph(
                f"The street takes {text(street.cpu_seconds, 2, 's')} of CPU time to build, once "
                f"for all frames of a rig; it is measured here while this report is made, on the "
                f"machine that makes it. A scene with its road user, path, ego car, cameras, "
                f"street and light is {own} values, every one of which has a default."
                + (f" This whole study is {lines} lines of YAML." if lines else "")
            ),
            Table(
                "building",
                "CPU seconds to make the meshes and the surfaces that rays meet, measured while "
                "this report was made, and their triangles.",
                ("what", "CPU seconds", "triangles"),
                tuple(rows),
            ),
            Table(
                "seconds",
                "CPU seconds a frame of the stages, as recorded when they were computed, each on "
                "one thread; mean of the runs. Rendering includes building the scene, once in "
                "each worker.",
                ("sweep", "setting", "render", "sensor noise", "match", "free space", "stixels"),
                tuple(_seconds(data)),
            ),
        ),
    )


def values_of(configuration: Configuration) -> int:
    """How many values the configuration's groups of the scene have."""

    def leaves(value) -> int:
        if dataclasses.is_dataclass(value):
            return sum(leaves(getattr(value, f.name)) for f in dataclasses.fields(value))
        return 1

    return sum(leaves(getattr(configuration, group)) for group in SCENE)


def cpu_seconds_a_frame(points: Iterable[StudyRun], stage: str) -> float:
    """Mean recorded CPU seconds of a stage for a frame; NaN where no run has any."""
    shares = [p.cpu_seconds.get(stage, math.nan) / len(p.scores.times) for p in points]
    shares = [share for share in shares if math.isfinite(share)]
    return sum(shares) / len(shares) if shares else math.nan


def _seconds(data: StudyData):
    named = {"rigs": rig, "matchers": matcher, "grids": grid}
    for name, label in named.items():
        sweep: StudySweep | None = data.sweeps.get(name)
        for setting, points in by_label(sweep.runs if sweep else (), label).items():
            stages = ("render", "add_sensor_noise", "match", "free_space", "stixels")
            yield (name, setting, *(cell(cpu_seconds_a_frame(points, stage)) for stage in stages))


def lines_of(study: str) -> int:
    """Lines of the study's file that say something; 0 if it is none of the shipped ones."""
    path = shipped_folder("pipelines") / "studies" / f"{study}.yaml"
    if not path.is_file():
        return 0
    lines = (line.strip() for line in path.read_text(encoding="utf-8").splitlines())
    return sum(1 for line in lines if line and not line.startswith("#"))
