"""Images without a benchmark's layout: a plain folder, or a pair whose files are named.

A plain folder has rig.yaml, left/000000.png, right/000000.png; optional labels.txt and poses.txt.
`rig.yaml` has `focal_length`, `principal_u`, `principal_v` (px), `baseline` (m), and optionally
`focal_length_v`, `principal_u_right` (px) and `camera_height` (m), or is a YAML file of ROS or
OpenCV. The images are rectified. `labels.txt` has the columns of KITTI tracking, in the frame of
the left camera, and `poses.txt` the rows of KITTI odometry. Of a named pair, the calibration is any
that `rig_files` reads.
"""

from pathlib import Path

from stixel_cli.recordings.assembly import assembled_pair, assembled_recording, numbered_images
from stixel_cli.recordings.parameters import LabelledFolder, Pair
from stixel_cli.recordings.rig_files import read_named_calibration, read_rig
from stixel_cli.recordings.types import Recording

RIG = "rig.yaml"


def is_layout(folder: Path) -> bool:
    """Whether the folder has this layout."""
    return (folder / RIG).is_file()


def find_recording(source: LabelledFolder) -> Recording:
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
    return assembled_pair(
        source,
        (Path(source.left), Path(source.right)),
        read_named_calibration(Path(source.calibration)),
        None if source.labels is None else Path(source.labels),
        None if source.disparity is None else Path(source.disparity),
    )
