"""One pair of images: of KITTI's object or stereo benchmarks, or each file named.

Below the folder of a benchmark, or below its `training/`:

- object (Geiger, Lenz, Urtasun 2012): `image_2/000123.png`, `image_3/…`, `calib/000123.txt` (P2,
  P3), `label_2/000123.txt`;
- stereo 2015 (Menze, Geiger 2015): `image_2/000123_10.png`, `image_3/…`,
  `calib_cam_to_cam/000123.txt` (P_rect_02, P_rect_03), `disp_occ_0/000123_10.png`;
- stereo 2012 (Geiger, Lenz, Urtasun 2012): `image_0/000123_10.png`, `image_1/…`, `calib/000123.txt`
  (P0, P1), `disp_occ/000123_10.png`.

Labels and true disparities are optional. There is one frame, without time, so the ego car does not
move. Of named files, the calibration is one of KITTI or a `rig.yaml`, see `plain_folder`.
"""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.files import opened
from stixel_cli.recordings.image_files import GREATEST_IMAGE, image_size, png_head
from stixel_cli.recordings.parameters import KittiPair, Pair
from stixel_cli.recordings.plain_folder import read_rig
from stixel_cli.recordings.tables import pair_names, read_calibration
from stixel_cli.recordings.types import Calibration, Recording

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


def is_benchmark(folder: Path) -> bool:
    """Whether the folder has the layout of one of the benchmarks."""
    root = _root(folder)
    return any(
        (root / left).is_dir() and (root / right).is_dir() and (root / calibration).is_dir()
        for left, right, _, calibration, *_ in BENCHMARKS.values()
    )


def _root(folder: Path) -> Path:
    """The folder that has the images: the folder itself or its `training`."""
    inner = folder / "training"
    return inner if inner.is_dir() else folder


def find_benchmark_pair(source: KittiPair) -> Recording:
    """The files of a pair, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid.
    """
    root, name = _root(Path(source.folder)), f"{int(source.sequence):06d}"
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


def find_named_pair(source: Pair) -> Recording:
    """The files of a pair, checked as far as their heads.

    Raises:
        UserError: if a file is missing or not valid.
    """
    calibration = Path(source.calibration)
    if calibration.suffix in (".yaml", ".yml"):
        found = read_rig(calibration)
    else:
        found = read_calibration(calibration, *pair_names(calibration))
    return pair_recording(
        source.kind,
        Path(source.folder),
        Path(source.right),
        found,
        None if source.labels is None else Path(source.labels),
        None if source.disparity is None else Path(source.disparity),
    )


def pair_recording(
    layout: str,
    left: Path,
    right: Path,
    calibration: Calibration,
    labels: Path | None,
    disparity: Path | None,
) -> Recording:
    """The recording of one pair, checked as far as the heads of the images.

    Raises:
        UserError: if an image is not valid, or they differ in size.
    """
    size = image_size(left)
    others = [(right, image_size(right))]
    if disparity is not None:
        with opened(disparity, GREATEST_IMAGE) as stream:
            others.append((disparity, png_head(disparity, stream.read(33) or b"")[:2]))
    for file, other in others:
        if other != size:
            raise UserError(
                f"{file}: {other[0]} × {other[1]} px, but {left.name} has {size[0]} × {size[1]} px"
            )
    return Recording(
        layout=layout,
        frames=range(1),
        left=(left,),
        right=(right,),
        width=size[0],
        height=size[1],
        calibration=calibration,
        label_files=() if labels is None else (labels,),
        true_disparities=() if disparity is None else (disparity,),
    )
