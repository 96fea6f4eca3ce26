"""KITTI's tracking benchmark: image_02, image_03, calib, label_02, and optional ego_poses.

Geiger, Lenz, Urtasun 2012, *Are we ready for autonomous driving?*. Below the folder, or below its
`training/`: `image_02/0005/000000.png`, `image_03/0005/…`, `calib/0005.txt`, `label_02/0005.txt`.
The benchmark has no poses of the ego car; `ego_poses/0005.txt` has them, one row per frame, as in
the odometry benchmark.
"""

from pathlib import Path

from stixel_cli.recordings.assembly import assembled_recording
from stixel_cli.recordings.kitti_calibration import read_calibration
from stixel_cli.recordings.listing import numbered_images
from stixel_cli.recordings.parameters import KittiTracking
from stixel_cli.recordings.types import Recording


def is_layout(folder: Path) -> bool:
    """Whether the folder has this layout."""
    return (root_of(folder) / "image_02").is_dir()


def root_of(folder: Path) -> Path:
    """The folder that has `image_02`: the folder itself or its `training`."""
    inner = folder / "training"
    return inner if inner.is_dir() and not (folder / "image_02").exists() else folder


def find_recording(source: KittiTracking) -> Recording:
    """The files of a clip and its target, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid.
    """
    root, name = root_of(Path(source.folder)), f"{int(source.sequence):04d}"
    return assembled_recording(
        source,
        read_calibration(root / "calib" / f"{name}.txt", "P2", "P3"),
        left=numbered_images(root / "image_02" / name),
        right=numbered_images(root / "image_03" / name),
        labels=(root / "label_02" / f"{name}.txt",),
        poses=(root / "ego_poses" / f"{name}.txt",),
        target=source.target,
    )
