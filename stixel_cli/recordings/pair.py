"""One pair of images, each file named: two images, a calibration, optional truth.

The calibration is a file of KITTI (rows P2 and P3, P0 and P1, or P_rect_02 and P_rect_03) or a
`rig.yaml`, see `plain_folder`.
"""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.files import opened
from stixel_cli.recordings.image_files import GREATEST_IMAGE, image_size, png_head
from stixel_cli.recordings.kitti_calibration import pair_names, read_calibration
from stixel_cli.recordings.parameters import Pair
from stixel_cli.recordings.plain_folder import read_rig
from stixel_cli.recordings.types import Calibration, Recording


def is_layout(folder: Path) -> bool:
    """False: no folder has it."""
    return False


def find_recording(source: Pair) -> Recording:
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
