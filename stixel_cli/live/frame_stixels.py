"""The stixels of one image pair: as arrays, a table, a scan, a file and a picture."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stixel_cli.config.real_images import real_image_parameters
from stixel_cli.geometry.pose import STRAIGHT_AHEAD
from stixel_cli.geometry.rig import Rig
from stixel_cli.stixels.types import FreeSpace, Stixels

if TYPE_CHECKING:
    import pandas

    from stixel_cli.measurements.scans import Scans


@dataclass(frozen=True, repr=False, eq=False)
class FrameStixels:
    """The n stixels of one frame, from left to right, and its free space.

    Attributes:
        rig: of the images, W × H px.
        stixels: of this frame, as the stage `stixels` of a run has them, with further arrays.
        free_space: of this frame; the unknown part of a column begins at its `unknown_row`.
        image: (H, W) uint8, the left image; None without images.
        columns: (n, 2) int32 px, the first column and the one after the last.
        rows: (n, 2) int32 px, top and base, both inclusive.
        depth: (n,) m along the road, straight ahead of the left camera; and variance: its, (n,) m².
        height: (n,) m, of the top above the road.
        points: (n, 2) m on the ground, to the right of the left camera and ahead of it.
        unknown: (W,) bool, columns of which a part is unknown: it may hide an obstacle.
    """

    rig: Rig
    stixels: Stixels
    free_space: FreeSpace
    image: np.ndarray | None = None

    def __post_init__(self) -> None:
        own = self.stixels
        vars(self).update(
            columns=np.stack([own.left, own.right], axis=1),
            rows=np.stack([own.top, own.base], axis=1),
            depth=own.depth,
            variance=own.covariances_ego[:, 1, 1],
            height=own.height,
            points=own.points_ego,
            unknown=self.free_space.unknown_row[0] >= 0,
        )

    def __len__(self) -> int:
        return len(self.stixels.left)

    def to_frame(self) -> "pandas.DataFrame":
        """A table with one row per stixel; `stixel assess --stixels` reads it as CSV.

        Its columns are those of `results.tables.stixel_columns`, without k.
        """
        import pandas

        from stixel_cli.results.tables import stixel_columns

        return pandas.DataFrame(stixel_columns([self.stixels])).drop(columns="k")

    def to_scan(self, pose: np.ndarray = (0.0, 0.0, STRAIGHT_AHEAD), time: float = 0.0) -> "Scans":
        """One scan for a tracker: the ground points inside the gates of height and range.

        `pose` (3,) is that of the camera in the world: x m, y m, heading rad. `time` is in s.
        """
        from stixel_cli.measurements.stixels import gather_scans
        from stixel_cli.scene.scenario import EgoMotion

        motion = EgoMotion(np.array([time]), np.array([pose], dtype=np.float64))
        return gather_scans([self.stixels], motion, real_image_parameters().measurement, self.rig)

    def to_stx1(self) -> bytes:
        """The content of a `.stx1` file, with the left image if there is one.

        Raises:
            UserError: without pyStixel-lib, `pip install 'stixel[stx1]'`.
        """
        from stixel_cli.export.stx1 import stixel_world
        from stixel_cli.images import encode_png
        from stixel_cli.measurements.stixel_file import stx1_library

        nothing = np.zeros(len(self), dtype=bool)
        world = stixel_world(stx1_library("to_stx1"), self.stixels, 0, nothing, self.rig, "car")
        if self.image is not None:
            world.image = encode_png(self.image)
        return world.SerializeToString()

    def draw(self, image: np.ndarray | None = None) -> np.ndarray:
        """A picture (H, W, 3) uint8 RGB: the stixels over the image, near yellow, far violet.

        `image` is (H, W) or (H, W, 3) uint8, by default the left image, or black without one.
        """
        from stixel_cli.pictures.frame_view import painted
        from stixel_cli.pictures.style import depth_colours

        image = self.image if image is None else image
        if image is None:
            image = np.zeros((self.rig.height, self.rig.width), dtype=np.uint8)
        return painted(image, self.stixels, depth_colours(self.depth))

    def __repr__(self) -> str:
        span = f", {self.depth.min():.1f} to {self.depth.max():.1f} m" if len(self) else ""
        unknown = f"{self.unknown.sum()} of {self.rig.width} columns with an unknown part"
        return f"<{len(self)} stixels{span}; {unknown}>"

    def _repr_png_(self) -> bytes:
        from stixel_cli.images import encode_png

        return encode_png(self.draw())
