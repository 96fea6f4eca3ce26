"""The stixels of one image pair: as arrays, a table, a scan, a file and a picture."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.geometry.rig import Rig
from stixel_cli.stixels.types import FreeSpace, Stixels

if TYPE_CHECKING:
    import pandas

    from stixel_cli.measurements.scans import Scans

OPACITY = 0.65
"""Of the stixels over the image, as in the pictures of a run."""


@dataclass(frozen=True, repr=False, eq=False)
class FrameStixels:
    """The n stixels of one frame, from left to right, and its free space.

    Attributes:
        rig: of the images, W × H px.
        stixels: all fields, as the stage `stixels` of a run has them, of one frame.
        free_space: of the same frame.
        image: (H, W) uint8, the left image; None without images.
    """

    rig: Rig
    stixels: Stixels
    free_space: FreeSpace
    image: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.stixels.left)

    @property
    def columns(self) -> np.ndarray:
        """First column and the column after the last (n, 2) int32, px."""
        return np.stack([self.stixels.left, self.stixels.right], axis=1)

    @property
    def rows(self) -> np.ndarray:
        """Top and base row (n, 2) int32, px, both inclusive."""
        return np.stack([self.stixels.top, self.stixels.base], axis=1)

    @property
    def depth(self) -> np.ndarray:
        """Depth (n,) m along the road, straight ahead of the left camera."""
        return self.stixels.depth

    @property
    def variance(self) -> np.ndarray:
        """Variance (n,) m² of the depth."""
        return self.stixels.covariances_ego[:, 1, 1]

    @property
    def height(self) -> np.ndarray:
        """Height (n,) m of the top above the road."""
        return self.stixels.height

    @property
    def points(self) -> np.ndarray:
        """Points (n, 2) m on the ground: to the right of the left camera, and ahead of it."""
        return self.stixels.points_ego

    @property
    def unknown(self) -> np.ndarray:
        """Which columns (W,) bool have a part of which nothing is known: it may hide an obstacle.

        The part begins at `free_space.unknown_row`.
        """
        return self.free_space.unknown_row[0] >= 0

    def to_frame(self) -> "pandas.DataFrame":
        """A table with one row per stixel; `stixel assess --stixels` reads it as CSV.

        Columns `left` to `right` - 1 and rows `top` to `base`, px; `disparity`, px, compensated for
        the pitch; `depth` and `height`, m; the ground point `x` (right), `y` (ahead), m, and its
        covariance `var_xx`, `var_xy`, `var_yy`, m².
        """
        import pandas

        stixels = self.stixels
        names = ("left", "right", "top", "base", "disparity", "depth", "height")
        points, covariances = stixels.points_ego, stixels.covariances_ego
        return pandas.DataFrame(
            {name: getattr(stixels, name) for name in names}
            | {"x": points[:, 0], "y": points[:, 1], "var_xx": covariances[:, 0, 0]}
            | {"var_xy": covariances[:, 0, 1], "var_yy": covariances[:, 1, 1]}
        )

    def to_scan(self, pose: np.ndarray | None = None, time: float = 0.0) -> "Scans":
        """One scan for a tracker: the ground points inside the gates of height and range.

        Args:
            pose: (3,) x m, y m, heading rad of the camera in the world; None for (0, 0, pi/2).
            time: s.
        """
        from stixel_cli.config.real_images import real_image_parameters
        from stixel_cli.measurements.stixels import gather_scans
        from stixel_cli.scene.scenario import EgoMotion

        pose = np.array([0.0, 0.0, STRAIGHT_AHEAD]) if pose is None else np.asarray(pose)
        motion = EgoMotion(np.array([time]), pose[None])
        return gather_scans([self.stixels], motion, real_image_parameters().measurement, self.rig)

    def to_stx1(self) -> bytes:
        """The content of a `.stx1` file, with the left image if there is one.

        Raises:
            UserError: without pyStixel-lib, `pip install 'stixel[stx1]'`.
        """
        from stixel_cli.export.stx1 import stixel_world, stx1_library
        from stixel_cli.images import encode_png

        nothing = np.zeros(len(self), dtype=bool)
        world = stixel_world(stx1_library("to_stx1"), self.stixels, 0, nothing, self.rig, "car")
        if self.image is not None:
            world.image = encode_png(self.image)
        return world.SerializeToString()

    def draw(self, image: np.ndarray | None = None) -> np.ndarray:
        """A picture (H, W, 3) uint8 RGB: the stixels, coloured by their depth, over the image.

        `image` is (H, W) or (H, W, 3) uint8, by default the left image, or black without one. Near
        stixels are yellow, far ones violet.
        """
        from stixel_cli.pictures.style import depth_colours

        image = self.image if image is None else image
        if image is None:
            image = np.zeros((self.rig.height, self.rig.width), dtype=np.uint8)
        picture = image.copy() if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
        for colour, (left, right), (top, base) in zip(
            255.0 * depth_colours(self.depth), self.columns, self.rows, strict=True
        ):
            area = picture[top : base + 1, left:right]
            area[...] = np.rint(OPACITY * colour + (1.0 - OPACITY) * area)
        return picture

    def __repr__(self) -> str:
        spans = f", {self.depth.min():.1f} to {self.depth.max():.1f} m" if len(self) else ""
        return (
            f"<{len(self)} stixels{spans}; {int(self.unknown.sum())} of {self.rig.width} columns "
            "with an unknown part>"
        )

    def _repr_png_(self) -> bytes:
        from stixel_cli.images import encode_png

        return encode_png(self.draw())
