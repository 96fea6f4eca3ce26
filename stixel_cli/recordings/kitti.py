"""Clips and pairs of KITTI's benchmarks, and the scenes of Virtual KITTI 2 that are made like them.

Geiger, Lenz, Urtasun 2012, *Are we ready for autonomous driving?*. Tracking: below the folder, or
below its `training/`, are `image_02/0005/000000.png`, `image_03/0005/…`, `calib/0005.txt`,
`label_02/0005.txt`, and `oxts/0005.txt` with the ego car's GPS/IMU. Poses of one's own in
`ego_poses/0005.txt`, one row per frame as in the odometry benchmark, take its place. That benchmark
has image_0 and image_1 (or 2 and 3), calib.txt and no labels; its `poses.txt`, which it has in
another folder, is expected next to the images.

Raw, synchronised and rectified: below the folder of a drive `image_02/data/0000000000.png`,
`image_03/data/…`, `oxts/data/0000000000.txt` and `tracklet_labels.xml`; there, or in the folder
above it, `calib_cam_to_cam.txt`, `calib_velo_to_cam.txt` and `calib_imu_to_velo.txt`.

Of one pair of images, below the folder of a benchmark, or below its `training/`:

- object (Geiger, Lenz, Urtasun 2012): `image_2/000123.png`, `image_3/…`, `calib/000123.txt` (P2,
  P3), `label_2/000123.txt`;
- stereo 2015 (Menze, Geiger 2015): `image_2/000123_10.png`, `image_3/…`,
  `calib_cam_to_cam/000123.txt` (P_rect_02, P_rect_03), `disp_occ_0/000123_10.png`;
- stereo 2012 (Geiger, Lenz, Urtasun 2012): `image_0/000123_10.png`, `image_1/…`, `calib/000123.txt`
  (P0, P1), `disp_occ/000123_10.png`.

Labels and true disparities are optional. There is one frame, without time, so the ego car does not
move.

Of Virtual KITTI 2 (Cabon, Murray, Humenberger 2020), below the folder of one variation of a scene,
such as `Scene01/clone`: `frames/rgb/Camera_0/rgb_00000.jpg` (left), `frames/rgb/Camera_1/…`
(right), and of the package `textgt`: `intrinsic.txt`, `extrinsic.txt`, `pose.txt`, `bbox.txt`,
`info.txt`.
"""

from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings.assembly import (
    assembled_pair,
    assembled_recording,
    numbered_images,
    root_of,
)
from stixel_cli.recordings.kitti_raw_tables import CAMERAS
from stixel_cli.recordings.kitti_tables import PAIRS, read_calibration
from stixel_cli.recordings.parameters import (
    KittiOdometry,
    KittiPair,
    KittiTracking,
    LabelledFolder,
)
from stixel_cli.recordings.types import Recording, Tables
from stixel_cli.recordings.virtual_kitti_tables import read_calibration as read_virtual_calibration

BENCHMARKS = (
    ("image_2/{}.png", "image_3/{}.png", "calib/{}.txt", "label_2/{}.txt", None),
    ("image_2/{}_10.png", "image_3/{}_10.png", "calib_cam_to_cam/{}.txt", None,
     "disp_occ_0/{}_10.png"),
    ("image_0/{}_10.png", "image_1/{}_10.png", "calib/{}.txt", None, "disp_occ/{}_10.png"),
)  # fmt: skip
"""Left and right image, calibration, labels and true disparities, by the number of a pair; their
cameras are the `PAIRS` of the same place."""

VIRTUAL_IMAGES = Path("frames/rgb")


def find_tracking(source: KittiTracking) -> Recording:
    """The recording of a clip of the tracking benchmark."""
    root, name = root_of(Path(source.folder), "image_02"), f"{int(source.sequence):04d}"
    tables, poses = clip_poses(root, name)
    return assembled_recording(
        source,
        read_calibration(root / "calib" / f"{name}.txt", ("P2", "P3")),
        numbered_images(root / "image_02" / name, root / "image_03" / name),
        labels=(root / "label_02" / f"{name}.txt",),
        poses=poses,
        tables=tables,
    )


def clip_poses(root: Path, name: str) -> tuple[Tables, tuple[Path, ...]]:
    """How the ego poses of a clip of the tracking benchmark are written, and their files."""
    own = root / "ego_poses" / f"{name}.txt"
    if own.is_file():
        return Tables(), (own,)
    calibration, packets = (root / kind / f"{name}.txt" for kind in ("calib", "oxts"))
    return Tables("kitti_oxts"), (calibration, calibration, calibration, packets)


def find_raw(source: LabelledFolder) -> Recording:
    """The recording of a drive of the raw data."""
    root = Path(source.folder)
    # The drives of a day share the calibration.
    at = root if (root / "calib_cam_to_cam.txt").is_file() else root.parent
    names = ("imu_to_velo", "velo_to_cam", "cam_to_cam")
    calibrations = [at / f"calib_{name}.txt" for name in names]
    _, velodyne, cameras = calibrations
    packets, folder = {}, root / "oxts/data"
    if folder.is_dir():
        (packets,) = numbered_images(folder, names=r"(\d{10})\.txt", example="0000000000.txt")
        if list(packets) != list(range(len(packets))):
            raise UserError(f"{folder}: must have all packets from 0000000000.txt on")
    return assembled_recording(
        source,
        read_calibration(cameras, CAMERAS),
        numbered_images(root / "image_02/data", root / "image_03/data"),
        poses=(*calibrations, *packets.values()) if packets else (),
        labels=(root / "tracklet_labels.xml", velodyne, cameras),
        tables=Tables("kitti_raw"),
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


def find_pair(source: KittiPair) -> Recording:
    """The recording of a benchmark's pair."""
    root, name = root_of(Path(source.folder), "image_2", "image_0"), f"{int(source.sequence):06d}"
    for files, cameras in zip(BENCHMARKS, PAIRS, strict=True):
        left, right, calibration, *truth = (file and root / file.format(name) for file in files)
        left, right = map(_png_or_jpeg, (left, right))
        if left.is_file():
            existing = [file if file and file.is_file() else None for file in truth]
            calibrated = read_calibration(calibration, cameras)
            return assembled_pair(source, (left, right), calibrated, *existing)
    images = " or ".join(files[0].format(name) for files in BENCHMARKS)
    raise UserError(f"source.sequence: {root} has no {images}")


def _png_or_jpeg(file: Path) -> Path:
    """The file, or the JPEG that is in its place."""
    jpeg = (file.with_suffix(ending) for ending in (".jpg", ".jpeg", ".JPG", ".JPEG"))
    return next((one for one in (file, *jpeg) if one.is_file()), file)


def find_virtual(source: LabelledFolder) -> Recording:
    """The recording of a variation of a scene of Virtual KITTI."""
    root = Path(source.folder)
    folders = (root / VIRTUAL_IMAGES / camera for camera in ("Camera_0", "Camera_1"))
    return assembled_recording(
        source,
        read_virtual_calibration(root / "intrinsic.txt", root / "extrinsic.txt"),
        numbered_images(*folders, names=r"rgb_(\d{5})\.jpg", example="rgb_00000.jpg"),
        poses=(root / "extrinsic.txt",),
        labels=tuple(root / name for name in ("pose.txt", "bbox.txt", "info.txt")),
        tables=Tables("virtual_kitti"),
    )
