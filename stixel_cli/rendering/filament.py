"""Open3D's rasteriser, run in a child process with a timeout and a restart after a failure."""

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering import placement
from stixel_cli.rendering.filament_process import REASON, main
from stixel_cli.rendering.frames import TARGET_ID, RenderedFrames
from stixel_cli.rendering.parameters import FilamentParameters
from stixel_cli.rendering.placement import rig_cameras
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario

COMMAND = (sys.executable, "-m", main.__module__)
"""The child process; the folder that it works in, or `--probe`, follows."""


class RendererUnavailable(UserError, RuntimeError):
    """Filament cannot start or continue; the message gives the reason in one line."""


def render(
    scenario: Scenario,
    road_user: RoadUser,
    world: World,
    rig: Rig,
    renderer: FilamentParameters,
    frames: range,
) -> RenderedFrames:
    """Render `frames` of the scenario without noise, as `raycast.render` does.

    Depth is Filament's own depth image, ids are its own rendering in flat colours.
    RendererUnavailable if the child hung or died `renderer.attempts` times.
    """
    objects = placement.numbered_objects(world, placement.motion_of(world, scenario))
    meshes = road_user_meshes(road_user)
    scene = describe_scene(scenario, objects, meshes, rig, frames)
    return RenderedFrames.from_frames(frames.start, rendered(scene, renderer, COMMAND))


def describe_scene(
    scenario: Scenario,
    objects: Iterable[tuple[int, Mesh]],
    targets: Sequence[Mesh],
    rig: Rig,
    frames: range,
) -> dict[str, Any]:
    """What the child reads.

    `objects` are (id, Mesh) of the world, `targets` the meshes of the target in its own frame, one
    for each pose of the limbs. `parts` have their id and their pose of the limbs, -1 for those that
    do not move.
    """
    shown = slice(frames.start, frames.stop)
    limb_poses = scenario.limb_poses[shown]
    moving = [(TARGET_ID, targets[pose], pose) for pose in np.unique(limb_poses)]
    meshes = [*((*one, -1) for one in objects), *moving]
    cameras = [rig_cameras(rig, pose) for pose in scenario.ego_poses_world[shown]]
    poses = scenario.target_poses_world[shown]
    focals = rig.focal, rig.focal_v
    return {
        "size": (rig.width, rig.height),
        "intrinsics": np.array([[*focals, u, rig.v0] for u in (rig.u0, rig.u0_right)]),
        "parts": [(part, number, pose) for number, mesh, pose in meshes for part in mesh],
        "limb_poses": limb_poses,
        "sun": placement.SUN,
        "sun_colour": placement.SUN_COLOUR,
        "light": placement.EXPOSURE * np.array([placement.SUNLIGHT, placement.AMBIENT]),
        "frames": frames,
        "cameras": [[np.column_stack([c.rotation, c.origin]) for c in pair] for pair in cameras],
        "target_poses": [placement.world_from_target_3d(pose) for pose in poses],
    }


def rendered(
    scene: dict[str, Any], renderer: FilamentParameters, command: Sequence[str]
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield (left, right, depth, ids) of each frame of `scene`, restarting the child as needed.

    RendererUnavailable if the child hung or died `renderer.attempts` times.
    """
    with tempfile.TemporaryDirectory(prefix="stixel-filament-") as name:
        folder, timeouts = Path(name), (renderer.start_timeout, renderer.frame_timeout)
        (folder / "scene").write_bytes(pickle.dumps(scene))
        for _ in range(renderer.attempts):
            problem = _run("filament", (*command, name), folder, *timeouts)
            if problem is None:
                break
        else:
            raise RendererUnavailable(
                f"{problem} ({renderer.attempts} attempts); renderer=raycast needs no driver"
            )
        for k in scene["frames"]:
            with np.load(folder / f"frame_{k}.npz", allow_pickle=False) as file:
                yield file["left"], file["right"], file["depth"], file["ids"]


def probe_filament(timeout: float, command: tuple[str, ...] = COMMAND) -> str | None:
    """As `probe`, of Filament."""
    return probe("filament", timeout, (*command, "--probe"))


def probe(renderer: str, timeout: float, command: Sequence[str]) -> str | None:
    """Why a renderer's `command` draws no picture here within `timeout` s, in one line, or None."""
    with tempfile.TemporaryDirectory(prefix=f"stixel-{renderer}-") as name:
        return _run(renderer, command, Path(name), timeout, timeout)


def _run(
    renderer: str, command: Sequence[str], folder: Path, start_timeout: float, frame_timeout: float
) -> str | None:
    """Run a child that writes files into `folder`; None if it ends well, else the failure.

    It hangs if it writes nothing within the first or, after that, the second timeout, s.
    """
    with (folder / "log").open("wb") as log:
        streams = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": log}
        environment = {**os.environ, "EGL_PLATFORM": "surfaceless"}
        child = subprocess.Popen(command, **streams, env=environment)
    task, timeout, written = "start", start_timeout, len([*folder.iterdir()])
    try:
        while child.returncode is None:
            try:
                child.wait(timeout=timeout)
            except subprocess.TimeoutExpired:
                before, written = written, len([*folder.iterdir()])
                if written == before:
                    return f"{renderer} did not {task} within {timeout:g} s"
                task, timeout = "render", frame_timeout
    finally:
        child.kill()
        child.wait()
    return _death(renderer, child, folder) if child.returncode else None


def _death(renderer: str, child: subprocess.Popen, folder: Path) -> str:
    """Why the child ended, in one line: the reason that it printed, or its signal and last line."""
    lines = (folder / "log").read_text(errors="replace").splitlines()
    lines = [line.strip() for line in lines if line.strip()]
    for line in lines:
        if line.startswith(REASON):
            return f"{renderer} cannot start: {line.removeprefix(REASON)}"
    code = child.returncode
    end = f"signal {-code}" if code < 0 else f"exit code {code}"
    return f"{renderer}'s process died with {end}" + (f": {lines[-1]}" if lines else "")
