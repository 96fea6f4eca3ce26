"""Open3D's rasteriser, run in a child process with a timeout and a restart after a failure."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from stixel_cli.errors import UserError
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering import placement
from stixel_cli.rendering.filament_process import REASON, main
from stixel_cli.rendering.frames import TARGET_ID, RenderedFrames
from stixel_cli.rendering.parameters import FilamentParameters
from stixel_cli.scene.mesh import Mesh
from stixel_cli.scene.parameters import RoadUser, World
from stixel_cli.scene.road_user import road_user_meshes
from stixel_cli.scene.scenario import Scenario

COMMAND = (sys.executable, "-m", main.__module__)
"""The child process; the folder that it works in follows."""


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
) -> dict[str, np.ndarray]:
    """The arrays that the child reads; `parts` (n, 3): texture, id, and pose of the limbs or -1.

    `objects` are (id, Mesh) of the world, `targets` the meshes of the target in its own frame, one
    for each pose of the limbs.
    """
    arrays: dict[str, np.ndarray] = {}
    numbers: dict[int, int] = {}  # of textures, by identity
    parts: list[tuple[int, int, int]] = []
    used = np.unique(scenario.limb_poses[frames.start : frames.stop])
    moving = [(TARGET_ID, targets[pose], pose) for pose in used]
    for identity, mesh, limb_pose in [*((*one, -1) for one in objects), *moving]:
        for part in mesh:
            number = numbers.setdefault(id(part.texture), len(numbers))
            arrays[f"texture_{number}"] = part.texture
            arrays[f"corners_{len(parts)}"] = part.vertices[part.triangles]
            arrays[f"uvs_{len(parts)}"] = part.uvs
            parts.append((number, identity, limb_pose))
    poses = [placement.rig_cameras(rig, scenario.ego_poses_world[k]) for k in frames]
    focals = rig.focal, rig.focal_v
    return arrays | {
        "size": np.array([rig.width, rig.height]),
        "intrinsics": np.array([[*focals, u, rig.v0] for u in (rig.u0, rig.u0_right)]),
        "parts": np.array(parts),
        "limb_poses": scenario.limb_poses[frames.start : frames.stop],
        "sun": placement.SUN,
        "sun_colour": placement.SUN_COLOUR,
        "light": placement.EXPOSURE * np.array([placement.SUNLIGHT, placement.AMBIENT]),
        "frames": np.array(frames),
        "cameras": np.array(
            [[np.column_stack([c.rotation, c.origin]) for c in pair] for pair in poses]
        ),
        "target_poses": np.array(
            [placement.world_from_target_3d(scenario.target_poses_world[k]) for k in frames]
        ),
    }


def rendered(
    scene: dict[str, np.ndarray], renderer: FilamentParameters, command: Sequence[str]
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield (left, right, depth, ids) of each frame of `scene`, restarting the child as needed.

    RendererUnavailable if the child hung or died `renderer.attempts` times.
    """
    with tempfile.TemporaryDirectory(prefix="stixel-filament-") as name:
        folder, timeouts = Path(name), (renderer.start_timeout, renderer.frame_timeout)
        np.savez(folder / "scene.npz", **scene)
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
        environment = {**os.environ, "EGL_PLATFORM": "surfaceless"}
        child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment
        )
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
