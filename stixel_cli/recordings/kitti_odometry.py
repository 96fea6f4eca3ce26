"""KITTI's odometry benchmark: image_0 and image_1 (or 2 and 3), calib.txt, poses.txt.

Geiger, Lenz, Urtasun 2012. There are no labels. `poses.txt`, which the benchmark has in another
folder, is expected in the folder of the images.
"""

from pathlib import Path

from stixel_cli.recordings.assembly import assembled_recording
from stixel_cli.recordings.kitti_calibration import read_calibration
from stixel_cli.recordings.listing import numbered_images
from stixel_cli.recordings.parameters import KittiOdometry
from stixel_cli.recordings.types import Recording


def is_layout(folder: Path) -> bool:
    """Whether the folder has this layout."""
    return (folder / "image_0").is_dir() and (folder / "calib.txt").is_file()


def find_recording(source: KittiOdometry) -> Recording:
    """The files of a clip, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid.
    """
    root = Path(source.folder)
    left, right = ("2", "3") if (root / "image_2").is_dir() else ("0", "1")
    return assembled_recording(
        source,
        read_calibration(root / "calib.txt", f"P{left}", f"P{right}"),
        left=numbered_images(root / f"image_{left}"),
        right=numbered_images(root / f"image_{right}"),
        poses=(root / "poses.txt",),
        target=source.target,
    )
