"""The stereo rig: projection, disparity and depth, and the pose of its camera.

Frames: camera (x right, y down, z forward, origin at the left camera, the reference); *level*, the
camera's frame turned upright by the pitch; ego ground plane (x right, y forward, origin below the
left camera) = (x, z) of the level frame. Pixel (u, v) has its centre at integer coordinates.
"""

from functools import cached_property
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le, Lt

from stixel_cli.geometry.pose import STRAIGHT_AHEAD, rotation
from stixel_cli.parameters import parameters

GREATEST_ERROR = 64.0
"""Of a disparity in any column of an image, px."""

Pixels = Annotated[float, Ge(-16), Le(16)]
PixelStd = Annotated[float, Ge(0), Le(16)]


@parameters
class Rig:
    """A rectified stereo rig; give `horizontal_fov` or `focal_length`.

    Attributes:
        width, height: image size, px.
        horizontal_fov: horizontal field of view, degrees; null if `focal_length` is given.
        focal_length: focal length, px; null if `horizontal_fov` is given.
        principal_u, principal_v: principal point, px; null is the image's centre.
        principal_u_right: column of the right camera's principal point, px; null: that of the left.
        baseline: distance of the two cameras, m.
        camera_height: height of the cameras above the road, m.
        pitch: rotation about the lateral axis, degrees, positive with the nose down.
        vertical_fov: vertical field of view, degrees; null for square pixels.
        disparity_error: error of the measured disparities, px of (1, x, x²) with x = (u - u0) / f:
            true d = measured d - c0 - c1 x - c2 x². 0 for a rig whose calibration is exact.
        disparity_error_std: standard deviations of that error at the image's left border, in its
            middle and at its right border, px, independent of each other.
    """

    width: Annotated[int, Ge(64), Le(4096)]
    height: Annotated[int, Ge(64), Le(4096)]
    horizontal_fov: Annotated[float, Ge(5), Lt(170)] | None
    focal_length: Annotated[float, Ge(10), Le(100_000)] | None
    principal_u: float | None
    principal_v: float | None
    baseline: Annotated[float, Ge(0.001), Le(5)]
    camera_height: Annotated[float, Ge(0.1), Le(20)]
    pitch: Annotated[float, Ge(-30), Le(30)]
    vertical_fov: Annotated[float, Ge(5), Lt(170)] | None
    disparity_error: tuple[Pixels, Pixels, Pixels] = (0.0, 0.0, 0.0)
    disparity_error_std: tuple[PixelStd, PixelStd, PixelStd] = (0.0, 0.0, 0.0)
    principal_u_right: float | None = None

    def check(self) -> None:
        """Raise ValueError for two focal lengths, or a principal point outside of the image."""
        _ = self.focal
        greatest = float(np.abs(self.disparity_errors() - self.far_disparity).max())
        if greatest > GREATEST_ERROR:
            raise ValueError(
                f"rig.disparity_error: must be <= {GREATEST_ERROR:g} px in all columns, "
                f"got {greatest:.0f} px"
            )
        for name, value, size in (
            ("principal_u", self.principal_u, self.width),
            ("principal_v", self.principal_v, self.height),
            ("principal_u_right", self.principal_u_right, self.width),
        ):
            if value is not None and not 0 <= value <= size - 1:
                raise ValueError(f"rig.{name}: must be 0 to {size - 1} (the image), got {value:g}")

    @cached_property
    def focal(self) -> float:
        """Horizontal focal length f_u in px: N_w / (2 tan(fov / 2)), thesis (4).

        ValueError unless exactly one of `horizontal_fov` and `focal_length` is given.
        """
        if (self.horizontal_fov is None) == (self.focal_length is None):
            raise ValueError(
                "rig.focal_length: set either rig.focal_length or rig.horizontal_fov, "
                "and set the other to null"
            )
        if self.focal_length is not None:
            return self.focal_length
        return self.width / (2.0 * np.tan(np.radians(self.horizontal_fov) / 2.0))

    @cached_property
    def focal_v(self) -> float:
        """Vertical focal length f_v in px: N_h / (2 tan(fov / 2)), thesis (4); else f_u."""
        if self.vertical_fov is None:
            return self.focal
        return self.height / (2.0 * np.tan(np.radians(self.vertical_fov) / 2.0))

    @property
    def field_of_view(self) -> tuple[float, float]:
        """Bearings of the image's right and left border, rad, counter-clockwise from ahead."""
        right = -np.arctan((self.width - 0.5 - self.u0) / self.focal)
        return float(right), float(np.arctan((self.u0 + 0.5) / self.focal))

    @property
    def u0(self) -> float:
        """Column of the principal point, px."""
        return 0.5 * (self.width - 1) if self.principal_u is None else self.principal_u

    @property
    def u0_right(self) -> float:
        """Column of the right camera's principal point, px."""
        return self.u0 if self.principal_u_right is None else self.principal_u_right

    @property
    def far_disparity(self) -> float:
        """Disparity in the images of an infinitely distant point, px."""
        return self.u0 - self.u0_right

    @property
    def v0(self) -> float:
        """Row of the principal point, px."""
        return 0.5 * (self.height - 1) if self.principal_v is None else self.principal_v

    @property
    def pitch_radians(self) -> float:
        """Pitch in rad, positive with the nose down."""
        return float(np.radians(self.pitch))

    @cached_property
    def level_from_camera(self) -> np.ndarray:
        """Rotation (3, 3) from the camera's frame to the level frame (x right, y down, z ahead)."""
        cosine, sine = np.cos(self.pitch_radians), np.sin(self.pitch_radians)
        return np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])

    @property
    def camera_matrix(self) -> np.ndarray:
        """Matrix (3, 3) px from points in the camera's frame to (u, v, 1) times their depth."""
        return np.array([[self.focal, 0.0, self.u0], [0.0, self.focal_v, self.v0], [0.0, 0.0, 1.0]])

    def disparity_from_depth(self, depth: float | np.ndarray) -> float | np.ndarray:
        """Disparity f_u B / z in px of depths z in m along the optical axis, any shape; (3)."""
        return self.focal * self.baseline / depth

    def disparity_errors(self) -> np.ndarray:
        """Difference (W,) px between the images' disparities in each column and f_u B / z.

        It is the sum of the stated error and `far_disparity`.
        """
        basis = self.disparity_error_basis(np.arange(self.width))
        return basis @ self.disparity_error + self.far_disparity

    def disparity_error_basis(self, columns: np.ndarray) -> np.ndarray:
        """(1, x, x²), (n, 3), at `columns` (n,) px: what `disparity_error` is multiplied by."""
        return np.vander((columns - self.u0) / self.focal, 3, increasing=True)

    @property
    def states_error(self) -> bool:
        """Whether an error of the disparities, or its standard deviation, is stated: not 0."""
        return any(self.disparity_error + self.disparity_error_std)

    @property
    def disparity_error_columns(self) -> np.ndarray:
        """The columns (3,) px of `disparity_error_std`."""
        return np.array([0.0, 0.5, 1.0]) * (self.width - 1)

    @property
    def disparity_error_factor(self) -> np.ndarray:
        """F (3, 3) px: the covariance of `disparity_error`, which all points share, is F Fᵀ."""
        values = self.disparity_error_basis(self.disparity_error_columns)
        return np.linalg.inv(values) * self.disparity_error_std

    def depth_from_disparity(self, disparity: float | np.ndarray) -> float | np.ndarray:
        """Depth f_u B / d in m along the optical axis of disparities d in px, any shape; (5)."""
        return self.focal * self.baseline / disparity

    def world_from_camera(self, ego_pose_world: np.ndarray) -> np.ndarray:
        """Rigid transform (4, 4) from the left camera to the 3-D world (x, y ground, z up, in m).

        `ego_pose_world` (3,) is (x, y, heading); the world is the ego car's frame at k = 0.
        """
        ego_from_level = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        world_from_ego = np.eye(3)
        world_from_ego[:2, :2] = rotation(float(ego_pose_world[2]) - STRAIGHT_AHEAD)
        transform = np.eye(4)
        transform[:3, :3] = world_from_ego @ ego_from_level @ self.level_from_camera
        transform[:3, 3] = [ego_pose_world[0], ego_pose_world[1], self.camera_height]
        return transform
