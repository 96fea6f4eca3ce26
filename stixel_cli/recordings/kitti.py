"""Clips of KITTI's tracking and odometry benchmarks.

Geiger, Lenz, Urtasun 2012, *Are we ready for autonomous driving?*. Tracking: below the folder, or
below its `training/`, are `image_02/0005/000000.png`, `image_03/0005/…`, `calib/0005.txt`,
`label_02/0005.txt`. The benchmark has no poses of the ego car; `ego_poses/0005.txt` has them, one
row per frame, as in the odometry benchmark. That has image_0 and image_1 (or 2 and 3), calib.txt
and no labels; its `poses.txt`, which it has in another folder, is expected next to the images.
"""

from pathlib import Path

from stixel_cli.recordings.assembly import assembled_recording, numbered_images, root_of
from stixel_cli.recordings.kitti_tables import read_calibration
from stixel_cli.recordings.parameters import KittiOdometry, KittiTracking
from stixel_cli.recordings.types import Recording


def is_tracking(folder: Path) -> bool:
    """Whether the folder has the layout of the tracking benchmark."""
    return (root_of(folder, "image_02") / "image_02").is_dir()


def is_odometry(folder: Path) -> bool:
    """Whether the folder has the layout of the odometry benchmark."""
    return (folder / "image_0").is_dir() and (folder / "calib.txt").is_file()


def find_tracking(source: KittiTracking) -> Recording:
    """The recording of a clip of the tracking benchmark."""
    root, name = root_of(Path(source.folder), "image_02"), f"{int(source.sequence):04d}"
    return assembled_recording(
        source,
        read_calibration(root / "calib" / f"{name}.txt", ("P2", "P3")),
        numbered_images(root / "image_02" / name, root / "image_03" / name),
        labels=(root / "label_02" / f"{name}.txt",),
        poses=(root / "ego_poses" / f"{name}.txt",),
    )


def find_odometry(source: KittiOdometry) -> Recording:
    """The recording of a clip of the odometry benchmark."""
    root = Path(source.folder)
    left, right = ("2", "3") if (root / "image_2").is_dir() else ("0", "1")
    return assembled_recording(
        source,
        read_calibration(root / "calib.txt", (f"P{left}", f"P{right}")),
        numbered_images(root / f"image_{left}", root / f"image_{right}"),
        poses=(root / "poses.txt",),
    )
