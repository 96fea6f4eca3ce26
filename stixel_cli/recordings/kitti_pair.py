"""One pair of KITTI's object, stereo 2012 or stereo 2015 benchmark.

Below the folder, or below its `training/`:

- object (Geiger, Lenz, Urtasun 2012): `image_2/000123.png`, `image_3/…`, `calib/000123.txt` (P2,
  P3), `label_2/000123.txt`;
- stereo 2015 (Menze, Geiger 2015): `image_2/000123_10.png`, `image_3/…`,
  `calib_cam_to_cam/000123.txt` (P_rect_02, P_rect_03), `disp_occ_0/000123_10.png`;
- stereo 2012 (Geiger, Lenz, Urtasun 2012): `image_0/000123_10.png`, `image_1/…`, `calib/000123.txt`
  (P0, P1), `disp_occ/000123_10.png`.

Labels and true disparities are optional. There is one frame, without time, so the ego car does not
move.
"""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.kitti_calibration import read_calibration
from stixel_cli.recordings.pair import pair_recording
from stixel_cli.recordings.parameters import KittiPair
from stixel_cli.recordings.types import Recording

BENCHMARKS = {
    "object": ("image_2", "image_3", "{}", "calib", ("P2", "P3"), "label_2", None),
    "2015": (
        "image_2",
        "image_3",
        "{}_10",
        "calib_cam_to_cam",
        ("P_rect_02", "P_rect_03"),
        None,
        "disp_occ_0",
    ),
    "2012": ("image_0", "image_1", "{}_10", "calib", ("P0", "P1"), None, "disp_occ"),
}
"""Folders of the left and right images, their names, folder and rows of the calibration, folders of
the labels and of the true disparities."""


def is_layout(folder: Path) -> bool:
    """Whether the folder has this layout."""
    root = root_of(folder)
    return any(
        (root / left).is_dir() and (root / right).is_dir() and (root / calibration).is_dir()
        for left, right, _, calibration, *_ in BENCHMARKS.values()
    )


def root_of(folder: Path) -> Path:
    """The folder that has the images: the folder itself or its `training`."""
    inner = folder / "training"
    return inner if inner.is_dir() else folder


def find_recording(source: KittiPair) -> Recording:
    """The files of a pair, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid.
    """
    root, name = root_of(Path(source.folder)), f"{int(source.sequence):06d}"
    for left, right, file, calibration, rows, labels, disparity in BENCHMARKS.values():
        image = file.format(name) + ".png"
        if not (root / calibration).is_dir() or not (root / left / image).is_file():
            continue
        return pair_recording(
            source.kind,
            root / left / image,
            root / right / image,
            read_calibration(root / calibration / f"{name}.txt", *rows),
            _existing(root, labels, f"{name}.txt"),
            _existing(root, disparity, image),
        )
    images = " or ".join(
        dict.fromkeys(
            f"{left}/{file.format(name)}.png" for left, _, file, *_ in BENCHMARKS.values()
        )
    )
    raise UserError(f"source.sequence: {root} has no {images}")


def _existing(root: Path, folder: str | None, name: str) -> Path | None:
    return None if folder is None or not (root / folder / name).is_file() else root / folder / name
