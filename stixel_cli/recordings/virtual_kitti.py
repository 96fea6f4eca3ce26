"""Virtual KITTI 2: one variation of a scene, such as `Scene01/clone`.

Cabon, Murray, Humenberger 2020, *Virtual KITTI 2*. Below the folder:
`frames/rgb/Camera_0/rgb_00000.jpg` (left), `frames/rgb/Camera_1/…` (right), and of the package
`textgt`: `intrinsic.txt`, `extrinsic.txt`, `pose.txt`, `bbox.txt`, `info.txt`.
"""

from pathlib import Path

from stixel_cli.recordings.assembly import assembled_recording, numbered_images
from stixel_cli.recordings.parameters import VirtualKitti
from stixel_cli.recordings.types import Recording, Tables
from stixel_cli.recordings.virtual_kitti_tables import read_calibration

IMAGES = Path("frames/rgb")
NAMES = r"rgb_(\d{5})\.jpg"
LABELS = ("pose.txt", "bbox.txt", "info.txt")


def is_layout(folder: Path) -> bool:
    """Whether the folder has this layout."""
    return (folder / IMAGES / "Camera_0").is_dir()


def find_recording(source: VirtualKitti) -> Recording:
    """The recording of a variation."""
    root = Path(source.folder)
    folders = (root / IMAGES / camera for camera in ("Camera_0", "Camera_1"))
    return assembled_recording(
        source,
        read_calibration(root / "intrinsic.txt", root / "extrinsic.txt"),
        numbered_images(*folders, names=NAMES, example="rgb_00000.jpg"),
        poses=(root / "extrinsic.txt",),
        labels=tuple(root / name for name in LABELS),
        tables=Tables("virtual_kitti"),
    )
