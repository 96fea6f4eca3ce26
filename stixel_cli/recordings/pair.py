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
from stixel_cli.recordings.assembly import root_of
from stixel_cli.recordings.image_files import image_size
from stixel_cli.recordings.kitti_tables import PAIRS, read_calibration
from stixel_cli.recordings.parameters import KittiPair, Pair
from stixel_cli.recordings.plain_folder import read_rig
from stixel_cli.recordings.types import Calibration, Recording, Tables

BENCHMARKS = (
    ("image_2/{}.png", "image_3/{}.png", "calib/{}.txt", "label_2/{}.txt", None),
    ("image_2/{}_10.png", "image_3/{}_10.png", "calib_cam_to_cam/{}.txt", None,
     "disp_occ_0/{}_10.png"),
    ("image_0/{}_10.png", "image_1/{}_10.png", "calib/{}.txt", None, "disp_occ/{}_10.png"),
)  # fmt: skip
"""Left and right image, calibration, labels and true disparities, by the number of a pair; their
cameras are the `PAIRS` of the same place."""


def is_benchmark(folder: Path) -> bool:
    """Whether the folder has the layout of one of the benchmarks."""
    root = root_of(folder, "image_2", "image_0")
    return any(all((root / file).parent.is_dir() for file in files[:3]) for files in BENCHMARKS)


def find_benchmark_pair(source: KittiPair) -> Recording:
    """The recording of a benchmark's pair."""
    root, name = root_of(Path(source.folder), "image_2", "image_0"), f"{int(source.sequence):06d}"
    for files, cameras in zip(BENCHMARKS, PAIRS, strict=True):
        left, right, calibration, *truth = (file and root / file.format(name) for file in files)
        if calibration.parent.is_dir() and left.is_file():
            existing = [file if file and file.is_file() else None for file in truth]
            calibrated = read_calibration(calibration, cameras)
            return _pair(source.kind, (left, right), calibrated, *existing)
    images = " or ".join(files[0].format(name) for files in BENCHMARKS)
    raise UserError(f"source.sequence: {root} has no {images}")


def find_named_pair(source: Pair) -> Recording:
    """The recording of a pair whose files are named."""
    file = Path(source.calibration)
    if file.suffix in (".yaml", ".yml"):
        calibration = read_rig(file)
    else:
        calibration = read_calibration(file, *PAIRS)
    return _pair(
        source.kind,
        (Path(source.folder), Path(source.right)),
        calibration,
        None if source.labels is None else Path(source.labels),
        None if source.disparity is None else Path(source.disparity),
    )


def _pair(
    layout: str,
    images: tuple[Path, Path],
    calibration: Calibration,
    labels: Path | None,
    disparity: Path | None,
) -> Recording:
    left, right = images
    size = image_size(left)
    others = {right: image_size(right)}
    if disparity is not None:
        others[disparity] = image_size(disparity, of_disparities=True)
    for file, other in others.items():
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
        tables=Tables(left_camera=calibration.left_camera),
        label_files=() if labels is None else (labels,),
        true_disparities=() if disparity is None else (disparity,),
    )
