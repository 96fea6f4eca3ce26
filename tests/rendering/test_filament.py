import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from box_scene import RAYCAST, RIG, objects, scenario, target_mesh
from constants import with_constants

from stixel_cli.errors import UserError
from stixel_cli.machine.health import PROBES
from stixel_cli.rendering import filament, filament_process, placement
from stixel_cli.rendering.filament import (
    RendererUnavailable,
    describe_scene,
    probe,
    rendered,
)
from stixel_cli.rendering.filament_process import (
    ID_STEPS,
    identities,
    identity_colour,
    main,
)
from stixel_cli.rendering.frames import SKY_ID, TARGET_ID, encoded
from stixel_cli.rendering.parameters import FilamentParameters
from stixel_cli.rendering.raycast import StaticScene, Target, render_frame
from stixel_cli.rendering.surfaces import linear_from_srgb

FILAMENT = with_constants(
    FilamentParameters("filament"), start_timeout=600, frame_timeout=600, attempts=3
)
HASTY = with_constants(FILAMENT, start_timeout=0.1, frame_timeout=0.1, attempts=2)
HANGS = (sys.executable, "-c", "import signal; signal.pause()")
DIES = (sys.executable, "-c", "import os, sys; print('no driver', file=sys.stderr); os.abort()")
SAYS_WHY = (sys.executable, "-c", "import sys; sys.exit('stixel: no EGL: not here')")

STAND_IN = """
import sys
from pathlib import Path
import numpy as np
folder = Path(sys.argv[-1])
with np.load(folder / "scene.npz") as scene:
    frames = scene["frames"]
(folder / "ready").touch()
for k in frames:
    result = folder / f"frame_{k}.npz"
    if result.exists():
        continue
    part = folder / "part.npz"
    np.savez(part, left=np.full(3, k), right=1, depth=2, ids=3)
    part.rename(result)
    # Every child dies after one frame.
    raise SystemExit(7)
"""


def describe(frames: range) -> dict[str, np.ndarray]:
    return describe_scene(scenario(), objects(), [target_mesh()], RIG, frames)


@pytest.fixture(scope="module")
def runs():
    """Of the stage's function, whose scene is this small one: two frames, and the second alone."""
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(placement, "motion_of", lambda *_: None)
            patch.setattr(placement, "numbered_objects", lambda *_: objects())
            patch.setattr(filament, "road_user_meshes", lambda _: [target_mesh()])
            given = {"scenario": scenario(), "road_user": None, "world": None, "rig": RIG}
            return [
                filament.render(**given, renderer=FILAMENT, frames=frames)
                for frames in (range(2), range(1, 2))
            ]
    except RendererUnavailable:
        problem = probe("filament", 60.0, PROBES["filament"])
        if problem is None:
            raise
    pytest.skip(problem)


def test_filament_agrees_with_the_ray_caster(runs):
    static, target = StaticScene(objects(), RIG, RAYCAST), Target([target_mesh()])
    for k in range(2):
        shots = runs[0]
        left, right, depth, ids = shots.left[k], shots.right[k], shots.depth(k), shots.ids[k]
        cast_left, cast_right, cast_depth, cast_ids = render_frame(static, target, scenario(), k)
        one, other = ids == TARGET_ID, cast_ids == TARGET_ID
        # A silhouette within 1 px: where they differ, it is at an edge of the other one.
        edge = cv2.morphologyEx(other.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3))) > 0
        assert not np.any((one != other) & ~edge)
        both = cv2.erode((one & other).astype(np.uint8), np.ones((3, 3))) > 0
        assert both.sum() > 150
        assert np.abs(depth[both] - cast_depth[both]).max() < 0.01
        assert (ids != cast_ids).mean() < 0.005
        assert np.all(np.isinf(depth) == (ids == SKY_ID))
        shown = ids != SKY_ID
        for picture, cast in ((left, cast_left), (right, cast_right)):
            grey, cast_grey = picture[shown].mean(axis=1), cast[shown].mean(axis=1)
            assert np.corrcoef(grey, cast_grey)[0, 1] > 0.8
            assert abs(grey.mean() - cast_grey.mean()) < 15


def test_filament_gives_the_same_bytes_in_another_process_and_chunk(runs):
    assert [frames.first for frames in runs] == [0, 1]
    for name in ("left", "right", "depth_high", "depth_low", "ids"):
        one, other = (getattr(frames, name) for frames in runs)
        assert np.array_equal(one[1], other[0]), name


def test_a_child_that_hangs_crashes_or_lacks_something_gives_one_line():
    with pytest.raises(RendererUnavailable, match=r"did not start within 0\.1 s \(2 attempts\)"):
        next(rendered(describe(range(1)), HASTY, HANGS))
    assert probe("filament", 0.1, HANGS) == "filament did not start within 0.1 s"
    patient = with_constants(FILAMENT, start_timeout=60.0, attempts=2)
    with pytest.raises(RendererUnavailable) as caught:
        next(rendered(describe(range(1)), patient, DIES))
    assert isinstance(caught.value, UserError)
    assert str(caught.value) == (
        "filament's process died with signal 6: no driver (2 attempts); "
        "renderer=raycast needs no driver"
    )
    assert probe("filament", 60.0, DIES).endswith("signal 6: no driver")
    assert probe("filament", 60.0, SAYS_WHY) == "filament cannot start: no EGL: not here"


def test_child_that_hangs_half_way_is_stopped():
    writes = "import pathlib, signal, sys; pathlib.Path(sys.argv[-1], 'ready').touch(); "
    command = (sys.executable, "-c", writes + "signal.pause()")
    hasty = with_constants(HASTY, start_timeout=5.0, attempts=1)
    with pytest.raises(RendererUnavailable, match=r"did not render within 0\.1 s \(1 attempts\)"):
        next(rendered(describe(range(2)), hasty, command))


def test_child_that_crashes_half_way_is_restarted_and_continues():
    patient = with_constants(FILAMENT, start_timeout=60.0, frame_timeout=60.0, attempts=5)
    command = (sys.executable, "-c", STAND_IN)
    frames = list(rendered(describe(range(3)), patient, command))
    assert [int(frame[0][0]) for frame in frames] == [0, 1, 2]


def test_ids_survive_the_encoding_as_colours():
    ids = np.arange(256)
    colours = np.array([identity_colour(int(identity))[:3] for identity in ids])
    # What the driver stores: linear light in eight bits, give or take one.
    light = linear_from_srgb(np.rint(255 * colours).astype(np.uint8))
    for wrong in (-1, 0, 1):
        stored = np.clip(np.rint(255 * light) + wrong, 0, 255).astype(np.uint8)
        assert np.array_equal(identities(stored[None])[0], ids)
    assert ID_STEPS**3 >= 256
    assert np.allclose(encoded(np.array([0.0, 1.0])), [0.0, 1.0])


@pytest.mark.parametrize(
    ("version", "needs"), [("0.19.0", "EGL: libEGL.so.1"), ("0.20.0", "Vulkan (0.19, ")]
)
def test_child_without_a_driver_names_the_version_that_needs_it(
    version, needs, monkeypatch, capsys
):
    def missing(name):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr("ctypes.CDLL", missing)
    library = SimpleNamespace(__version__=version)
    monkeypatch.setattr(filament_process, "import_open3d", lambda: library)
    assert main(["--probe"]) == 3
    assert capsys.readouterr().err.startswith(f"stixel: Open3D {version} needs {needs}")
