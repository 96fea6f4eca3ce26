"""Images without a benchmark's layout: a plain folder, or a pair whose files are named.

A plain folder has rig.yaml, left/000000.png, right/000000.png; optional labels.txt and poses.txt.
`rig.yaml` has `focal_length`, `principal_u`, `principal_v` (px), `baseline` (m), and optionally
`focal_length_v` (px) and `camera_height` (m). The images are rectified. `labels.txt` has the
columns of KITTI tracking, in the frame of the left camera, and `poses.txt` the rows of KITTI
odometry. Of a named pair, the calibration is one of KITTI or a `rig.yaml`.
"""

from pathlib import Path

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_yaml
from stixel_cli.recordings.assembly import assembled_recording, numbered_images
from stixel_cli.recordings.kitti import recording_of_pair
from stixel_cli.recordings.kitti_tables import PAIRS, read_calibration
from stixel_cli.recordings.parameters import Pair, PlainFolder
from stixel_cli.recordings.types import Calibration, Recording

RIG = "rig.yaml"
NEEDED = ("focal_length", "principal_u", "principal_v", "baseline")
OPTIONAL = ("focal_length_v", "camera_height")


def is_layout(folder: Path) -> bool:
    """Whether the folder has this layout."""
    return (folder / RIG).is_file()


def find_recording(source: PlainFolder) -> Recording:
    """The recording of the folder."""
    root = Path(source.folder)
    return assembled_recording(
        source,
        read_rig(root / RIG),
        numbered_images(root / "left", root / "right"),
        labels=(root / "labels.txt",),
        poses=(root / "poses.txt",),
    )


def find_named_pair(source: Pair) -> Recording:
    """The recording of a pair whose files are named."""
    calibration = read_named_calibration(Path(source.calibration))
    return recording_of_pair(
        source.kind,
        (Path(source.folder), Path(source.right)),
        calibration,
        None if source.labels is None else Path(source.labels),
        None if source.disparity is None else Path(source.disparity),
    )


def read_named_calibration(file: Path) -> Calibration:
    """The calibration in a `rig.yaml`, or in a file of KITTI; UserError if it is not valid."""
    if file.suffix in (".yaml", ".yml"):
        return read_rig(file)
    return read_calibration(file, *PAIRS)


def read_rig(file: Path) -> Calibration:
    """The calibration in `rig.yaml`.

    Raises:
        UserError: if a value is missing, not a number, or unknown.
    """
    content = read_yaml(file)
    if not isinstance(content, dict):
        raise UserError(f"{file}: must map names to values")
    for name in content:
        if name not in NEEDED + OPTIONAL:
            known = ", ".join(NEEDED + OPTIONAL)
            raise UserError(f"{file}: {printable(str(name))}: unknown; it has {known}")
    for name in NEEDED:
        if name not in content:
            raise UserError(f"{file}: {name} is missing")
    for name, value in content.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise UserError(f"{file}: {name}: must be a number")
    if content["baseline"] < 0.001:
        raise UserError(f"{file}: baseline: must be at least 0.001 m, got {content['baseline']:g}")
    if content["focal_length"] <= 0:
        raise UserError(f"{file}: focal_length: must be > 0, got {content['focal_length']:g}")
    absent = {"focal_length_v": content["focal_length"], "camera_height": None}
    return Calibration(**absent | content)
