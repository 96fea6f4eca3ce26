"""The child process that renders with Filament, run as a module with the folder DIR.

DIR has `scene.npz`, written by `filament.py`; for each frame the child leaves `frame_<k>.npz`
there, and `ready` as soon as it has rendered anything. With `--probe` it renders one small picture
of nothing and ends. It protects its parent: without a driver, Filament aborts in C++ or
hangs. A known reason goes to stderr in one line that starts with `REASON`.
"""

import ctypes
import sys
from pathlib import Path

import numpy as np

from stixel_cli.rendering.frames import encoded
from stixel_cli.scene.open3d_import import import_open3d

REASON = "stixel: "

NEAR, FAR = 0.1, 400.0
"""Clip planes, m."""

SUN_UNIT = 237_500.0
"""Lux that light a white surface, facing the sun, to 1 (measured on Open3D's exposure)."""

AMBIENT_UNIT = 62_000.0
"""Intensity of Open3D's default surroundings that lights a white, level surface to 1 (measured)."""

GAIN = 8.0
"""Dark parts come from a second exposure, this much longer: without its post-processing, which
dithers at random, Filament gives 8 bits in linear light, too coarse for shadows."""

ID_STEPS = 8
"""Levels of red, green and blue that spell an object id, one octal digit each."""

FINER = 2
"""Pictures are rendered this much finer along each axis and averaged: anti-aliasing."""

SKY = (0.52, 0.66, 0.84)
"""Linear light of the sky."""


class Stage:
    """Filament's scene: every part twice, as it looks and as its flat identity."""

    def __init__(self, scene: dict):
        self.scene = scene
        self.open3d = import_open3d()
        self.rendering = self.open3d.visualization.rendering
        self.width, self.height = (int(n) for n in scene["size"])
        self.renderer = self.rendering.OffscreenRenderer(FINER * self.width, FINER * self.height)
        view = self.renderer.scene.view
        # All that follows the picture is random in time, or smears identities.
        view.set_post_processing(False)
        view.set_antialiasing(False)
        view.set_ambient_occlusion(False)
        view.set_sample_count(1)
        self.renderer.scene.show_skybox(False)
        # Of each part, and the pose of the limbs that it belongs to; -1 for those that do not move.
        self.names: list[tuple[str, str, int]] = []
        self.limb_pose = -1
        for n, part in enumerate(scene["parts"].tolist()):
            self._add(n, *part)
        self._lights(1.0)

    def _add(self, n: int, texture: int, identity: int, limb_pose: int) -> None:
        """Add part `n`; corners are not shared, so that every triangle is flat."""
        library, scene = self.open3d, self.scene
        corners = scene[f"corners_{n}"].reshape(-1, 3)
        mesh = library.geometry.TriangleMesh(
            library.utility.Vector3dVector(corners),
            library.utility.Vector3iVector(np.arange(len(corners), dtype=np.int32).reshape(-1, 3)),
        )
        # Open3D's v goes upwards, from the image's last row.
        uvs = scene[f"uvs_{n}"].reshape(-1, 2) * [1.0, -1.0]
        mesh.triangle_uvs = library.utility.Vector2dVector(uvs)
        mesh.compute_triangle_normals()
        mesh.vertex_normals = library.utility.Vector3dVector(
            np.repeat(np.asarray(mesh.triangle_normals), 3, axis=0)
        )
        looks = self.rendering.MaterialRecord()
        looks.shader = "defaultLit"
        looks.base_roughness, looks.base_reflectance, looks.base_metallic = 1.0, 0.0, 0.0
        looks.albedo_img = library.geometry.Image(np.ascontiguousarray(scene[f"texture_{texture}"]))
        flat = self.rendering.MaterialRecord()
        flat.shader = "unlitSolidColor"
        flat.base_color = identity_colour(identity)
        self.renderer.scene.add_geometry(f"looks {n}", mesh, looks)
        self.renderer.scene.add_geometry(f"flat {n}", mesh, flat)
        self.names.append((f"looks {n}", f"flat {n}", limb_pose))

    def _lights(self, gain: float) -> None:
        scene = self.renderer.scene.scene
        light = self.scene["light"] * gain
        scene.set_sun_light(
            (-self.scene["sun"]).astype(np.float32),
            self.scene["sun_colour"].astype(np.float32),
            float(SUN_UNIT * light[0]),
        )
        scene.enable_sun_light(True)
        scene.enable_indirect_light(True)
        scene.set_indirect_light_intensity(float(AMBIENT_UNIT * light[1]))
        sky = np.clip(np.array(SKY) * gain, 0.0, 1.0)
        self.renderer.scene.set_background([*(float(c) for c in encoded(sky)), 1.0])

    def frame(self, index: int) -> dict[str, np.ndarray]:
        """`left`, `right` (H, W, 3) uint8 sRGB, `depth` (H, W) float32 m, `ids` (H, W) uint8."""
        pose = self.scene["target_poses"][index]
        self.limb_pose = int(self.scene["limb_poses"][index])
        for looks, flat, limb_pose in self.names:
            if limb_pose == self.limb_pose:
                self.renderer.scene.set_geometry_transform(looks, pose)
                self.renderer.scene.set_geometry_transform(flat, pose)
        cameras = list(zip(self.scene["cameras"][index], self.scene["intrinsics"], strict=True))
        left, right = (self._picture(*camera) for camera in cameras)
        self._show(flat=True)
        self._look(*cameras[0], 0.0)
        self.renderer.scene.set_background([0.0, 0.0, 0.0, 1.0])
        ids = identities(self._image()[::FINER, ::FINER])
        depth = np.asarray(self.renderer.render_to_depth_image(z_in_view_space=True))
        depth = depth[::FINER, ::FINER].astype(np.float32)
        return {"left": left, "right": right, "depth": depth, "ids": ids}

    def _picture(self, camera: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
        self._show(flat=False)
        # The mean of the fine pixels' places is the coarse pixel's.
        self._look(camera, intrinsics, 0.5 * (FINER - 1))
        self._lights(1.0)
        light = self._image() / 255.0
        self._lights(GAIN)
        longer = self._image() / 255.0
        dark = longer.max(axis=2, keepdims=True) < 1.0
        light = np.where(dark, longer / GAIN, light)
        light = light.reshape(self.height, FINER, self.width, FINER, 3).mean(axis=(1, 3))
        return np.rint(255.0 * encoded(light)).astype(np.uint8)

    def _image(self) -> np.ndarray:
        # The first image after a change may still have the shadow map of the one before.
        self.renderer.render_to_image()
        return np.asarray(self.renderer.render_to_image())[..., :3].copy()

    def _show(self, flat: bool) -> None:
        for looks, plain, limb_pose in self.names:
            shown = limb_pose in (-1, self.limb_pose)
            self.renderer.scene.show_geometry(looks, shown and not flat)
            self.renderer.scene.show_geometry(plain, shown and flat)

    def _look(self, camera: np.ndarray, intrinsics: np.ndarray, shift: float) -> None:
        """Look through a camera (3, 4 to the world), the fine image shifted by `shift` px.

        Unshifted, the fine pixel (FINER u, FINER v) looks along the ray of the pixel (u, v).
        """
        focal_u, focal_v, u0, v0 = FINER * intrinsics
        # Filament's first pixel reaches from 0 to 1; here its centre is at 0.
        shift += 0.5
        matrix = np.array([[focal_u, 0.0, u0 + shift], [0.0, focal_v, v0 + shift], [0.0, 0.0, 1.0]])
        width, height = float(FINER * self.width), float(FINER * self.height)
        lens = self.renderer.scene.camera
        lens.set_projection(matrix, NEAR, FAR, width, height)
        eye = camera[:3, 3]
        lens.look_at(
            (eye + camera[:3, 2]).astype(np.float32),
            eye.astype(np.float32),
            (-camera[:3, 1]).astype(np.float32),
        )


def identity_colour(identity: int) -> list[float]:
    """sRGB and opacity of an id below `ID_STEPS`³, to be read back by `identities`."""
    digits = np.array([identity // ID_STEPS**2, identity // ID_STEPS, identity]) % ID_STEPS
    return [*(float(c) for c in encoded(digits / (ID_STEPS - 1.0))), 1.0]


def identities(image: np.ndarray) -> np.ndarray:
    """Ids (H, W) uint8 in an image (H, W, 3) uint8 of flat colours in linear light."""
    digits = np.rint(image / 255.0 * (ID_STEPS - 1)).astype(np.int32)
    return (digits @ np.array([ID_STEPS**2, ID_STEPS, 1])).astype(np.uint8)


def missing_driver(version: str) -> str | None:
    """Which driver Filament of this version of Open3D needs, if it is missing; in one line."""
    with_egl = version.startswith("0.19.")
    try:
        ctypes.CDLL("libEGL.so.1" if with_egl else "libvulkan.so.1")
    except OSError as problem:
        needs = "EGL" if with_egl else "Vulkan (0.19, for Python 3.11 and 3.12, needs EGL)"
        return f"Open3D {version} needs {needs}: {problem}"
    return None


def main(arguments: list[str]) -> int:
    """Render what `arguments` ([DIR] or ['--probe']) ask for; the process's exit code."""
    open3d = import_open3d()
    if problem := missing_driver(open3d.__version__):
        print(f"{REASON}{problem}", file=sys.stderr)  # noqa: T201
        return 3
    if arguments == ["--probe"]:
        open3d.visualization.rendering.OffscreenRenderer(64, 64).render_to_image()
        return 0
    folder = Path(arguments[0])
    with np.load(folder / "scene.npz", allow_pickle=False) as file:
        scene = dict(file)
    stage = Stage(scene)
    (folder / "ready").touch()
    for index, k in enumerate(scene["frames"]):
        result = folder / f"frame_{k}.npz"
        if result.exists():
            continue
        written = folder / f"part_{k}.npz"
        np.savez(written, **stage.frame(index))
        written.rename(result)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
