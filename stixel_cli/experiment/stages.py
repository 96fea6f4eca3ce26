"""The table of stages: what the engine needs to know of each, kept outside the domain rooms.

A row says which function does the work, which slice of the configuration each of its arguments is,
and how the stage runs over the frames.
`pipelines/*.yaml` wires rows by name.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import yaml

from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.schema import Configuration
from stixel_cli.engine.stage import Stage
from stixel_cli.errors import UserError
from stixel_cli.scene.mesh_references import referred_files

CHUNK_SIZE = 10
"""Frames a node: small enough that two workers stay busy, large enough to share a background."""


@dataclass(frozen=True)
class Definition:
    """One row of the table.

    Attributes:
        functions: "module:function" to call, by the `kind` of the slice that `chosen_by` names; a
            stage of one implementation has the single entry "".
        pattern: how it runs over the frames, see `stixel_cli.engine.stage.Stage`.
        reads: argument name to the dotted path of its slice in the configuration.
        modules: code that no import statement leads to, see `Stage.modules`.
        chosen_by: dotted path of the slice whose `kind` picks the function; "" if there is no
            choice.
        seeded: whether it draws random numbers, and so is given the experiment's seed.
        reads_mesh: whether it reads the user's own mesh file, and those that this refers to.
    """

    functions: Mapping[str, str]
    pattern: Literal["once", "map", "fold", "pick"]
    reads: Mapping[str, str] = field(default_factory=dict)
    modules: tuple[str, ...] = ()
    chosen_by: str = ""
    seeded: bool = False
    reads_mesh: bool = False


def _only(function: str) -> dict[str, str]:
    return {"": f"stixel_cli.{function}"}


def _same(*names: str) -> dict[str, str]:
    return {name: name for name in names}


TABLE: dict[str, Definition] = {
    "ego_motion": Definition(
        _only("scene.ego:ego_motion"),
        "once",
        {"ego": "ego", "duration": "path.duration", "sample_time": "path.sample_time"},
    ),
    "scenario": Definition(
        _only("scene.build:build_scenario"),
        "once",
        _same("road_user", "path"),
        reads_mesh=True,
    ),
    "render": Definition(
        {
            "raycast": "stixel_cli.rendering.raycast:render",
            "filament": "stixel_cli.rendering.filament:render",
        },
        "map",
        _same("road_user", "world", "rig", "renderer"),
        chosen_by="renderer",
        reads_mesh=True,
    ),
    "add_sensor_noise": Definition(
        _only("rendering.sensor_noise:add_sensor_noise"),
        "map",
        _same("sensor"),
        seeded=True,
    ),
    "match": Definition(
        {"sgm": "stixel_cli.stereo.sgm:match", "bm": "stixel_cli.stereo.bm:match"},
        "map",
        _same("rig", "stereo"),
        chosen_by="stereo",
    ),
    "free_space": Definition(
        _only("stixels.free_space:find_free_space"),
        "fold",
        _same("rig", "road", "occupancy", "free_space"),
    ),
    "stixels": Definition(
        _only("stixels.extraction:extract_stixels"),
        "map",
        _same("rig", "height", "extraction"),
    ),
    "gather_scans": Definition(
        _only("measurements.simulated:gather_scans"), "once", _same("measurement")
    ),
    "fabricate_scans": Definition(
        _only("measurements.fabricated:fabricate_scans"),
        "once",
        _same("rig", "measurement"),
        seeded=True,
    ),
    "cast_lidar": Definition(
        _only("measurements.lidar_casting:cast_lidar"),
        "once",
        {
            "road_user": "road_user",
            "world": "world",
            "scanner": "measurement.scanner",
            "camera_field": "rig.field_of_view",
        },
        reads_mesh=True,
    ),
    "lidar_scans": Definition(
        _only("measurements.lidar:lidar_scans"), "once", _same("measurement"), seeded=True
    ),
    "start": Definition(_only("tracking.start:noisy_start"), "once", _same("start"), seeded=True),
    "track": Definition(
        {
            "gp_ekf": "stixel_cli.tracking.gp_ekf:track",
            "point": "stixel_cli.tracking.point:track",
        },
        "once",
        _same("prior", "tracker"),
        chosen_by="tracker",
    ),
    "scores": Definition(_only("evaluation.evaluate:evaluate"), "once"),
    "stage_errors": Definition(
        _only("validation.stage_errors:stage_errors"),
        "map",
        _same("rig", "road", "occupancy", "free_space"),
    ),
    "point_errors": Definition(_only("validation.point_errors:point_errors"), "once", _same("rig")),
    "occupancy": Definition(
        _only("stixels.displayed_grid:picture_grid"),
        "pick",
        _same("rig", "road", "occupancy"),
    ),
    "camera_pictures": Definition(
        _only("report.camera:camera_pictures"),
        "pick",
        _same("rig"),
    ),
    "camera_frames": Definition(
        _only("report.camera_frames:camera_frames"),
        "map",
    ),
    "track_pictures": Definition(
        _only("report.birds_eye:track_pictures"),
        "pick",
        _same("rig"),
    ),
    "run_pictures": Definition(
        _only("report.over_time:run_pictures"),
        "once",
        _same("rig"),
    ),
}


def pipeline_stages(configuration: Configuration) -> list[Stage]:
    """The stages of one experiment, wired as the file of its kind of measurement says.

    Raises:
        UserError: if the pipeline's file is missing or names what the table does not know.
    """
    path = shipped_folder("pipelines") / f"{configuration.measurement.kind}.yaml"
    return [_stage(configuration, path, name, wiring or {}) for name, wiring in _read(path).items()]


def scan_count(configuration: Configuration) -> int:
    """Number K of scans: duration / sample time, rounded, and at least one."""
    return max(1, round(configuration.path.duration / configuration.path.sample_time))


def pictured_frames(configuration: Configuration) -> tuple[int, ...]:
    """The frames to draw: those asked for, or four spread evenly over the run."""
    chosen = configuration.pictures.frames
    if chosen is not None:
        return tuple(sorted(set(chosen)))
    last = scan_count(configuration) - 1
    return tuple(sorted({round(last * share / 4) for share in (0.5, 1.5, 2.5, 3.5)}))


def _read(path: Path) -> dict[str, dict[str, str] | None]:
    try:
        stat = path.stat()
        return _parse(path, stat.st_mtime_ns, stat.st_size)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise UserError(f"{path}: not a YAML file: {str(error).splitlines()[0]}") from error


@lru_cache(maxsize=16)
def _parse(path: Path, *state: int) -> dict[str, dict[str, str] | None]:
    """Content of the file, parsed once for all points of a sweep while its `state` is the same."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def _stage(configuration: Configuration, path: Path, name: str, wiring: dict[str, str]) -> Stage:
    inputs = dict(wiring)
    row = inputs.pop("stage", name)
    if row not in TABLE:
        raise UserError(f"{path}: {name}: no stage {row!r}; the table has {', '.join(TABLE)}")
    definition = TABLE[row]
    kind = _slice(configuration, f"{definition.chosen_by}.kind") if definition.chosen_by else ""
    mesh = configuration.road_user.mesh
    return Stage(
        name=name,
        function=definition.functions[kind],
        pattern=definition.pattern,
        inputs=inputs,
        settings={a: _slice(configuration, p) for a, p in definition.reads.items()},
        modules=definition.modules,
        seed=configuration.seed if definition.seeded else None,
        frames=pictured_frames(configuration) if definition.pattern == "pick" else (),
        files=_mesh_files(Path(mesh)) if definition.reads_mesh and mesh is not None else (),
        keys=definition.reads,
    )


def _mesh_files(mesh: Path) -> tuple[Path, ...]:
    return (mesh, *referred_files(mesh))


def _slice(configuration: Configuration, path: str) -> Any:
    value: Any = configuration
    for part in path.split("."):
        value = getattr(value, part)
    return value
