"""The recording of a configuration's `source`, in whichever layout it is; see docs/real-data.md.

KITTI (Geiger, Lenz, Urtasun 2012, *Are we ready for autonomous driving?*), below the folder or its
`training/`: the tracking benchmark, in which poses of one's own in `ego_poses/0005.txt` take the
place of the GPS/IMU in `oxts`; the odometry benchmark, whose `poses.txt` is expected next to the
images; raw drives, synchronised and rectified. One pair of images is of its object, stereo 2012 or
stereo 2015 benchmark (Menze, Geiger 2015), or its files are named. It has one frame, without time,
so the ego car does not move. Virtual KITTI 2 (Cabon, Murray, Humenberger 2020): one variation of a
scene, with the package `textgt`. Argoverse 2 (Wilson et al. 2021): one log, whose frames are
numbered from 0 in the order of the left images. A plain folder: rig.yaml, and images that are
rectified; `labels.txt` has the columns of KITTI tracking, in the frame of the left camera, and
`poses.txt` the rows of KITTI odometry.
"""

import re
from dataclasses import replace
from pathlib import Path

from stixel_cli.errors import UserError
from stixel_cli.recordings import argoverse, parameters, rosbag, virtual_kitti_tables
from stixel_cli.recordings.image_files import image_size, read_disparity
from stixel_cli.recordings.kitti_tables import PAIRS, clip_poses, read_calibration, root_of
from stixel_cli.recordings.rig_files import read_named_calibration, read_rig
from stixel_cli.recordings.tables import labels_of, read_poses
from stixel_cli.recordings.times import check_steps, common_frames, pairs_by_time
from stixel_cli.recordings.types import Calibration, Recording, Rectification, Tables

MOST_FILES = 200_000
"""In a folder of images."""

Images = dict[int, Path]
"""The images of one camera by their number."""

BENCHMARKS = (
    ("image_2/{}.png", "image_3/{}.png", "calib/{}.txt", "label_2/{}.txt", None),
    ("image_2/{}_10.png", "image_3/{}_10.png", "calib_cam_to_cam/{}.txt", None,
     "disp_occ_0/{}_10.png"),
    ("image_0/{}_10.png", "image_1/{}_10.png", "calib/{}.txt", None, "disp_occ/{}_10.png"),
)  # fmt: skip
"""Left and right image, calibration, labels and true disparities, by the number of a pair; their
cameras are the `PAIRS` of the same place."""

VIRTUAL_IMAGES, LOG_IMAGES = Path("frames/rgb"), Path("sensors/cameras")


def find_recording(source: parameters.Source) -> Recording:
    """The files of a recording, checked as far as their heads."""
    if source.kind not in ("pair", "rosbag") and not Path(source.folder).is_dir():
        raise UserError(f"source.folder: {source.folder}: no such folder")
    return next(find for kind, find, *_ in LAYOUTS if kind == source.kind)(source)


def guess_layout(folder: Path) -> str:
    """The layout of a folder, as the option of `source`."""
    if folder.suffix in rosbag.SUFFIXES and folder.is_file():
        return "rosbag"
    if not folder.is_dir():
        raise UserError(f"source.folder: {folder}: no such folder")
    marked = [(kind, marks) for kind, _, *others in LAYOUTS for marks in others]
    for kind, marks in marked:
        if all((root_of(folder, marks[0]) / mark).exists() for mark in marks):
            return kind
    known = ", ".join(f"{' and '.join(marks)} (source={kind})" for kind, marks in marked)
    raise UserError(f"source.folder: {folder}: not a known layout, which has one of: {known}")


def _tracking(source: parameters.KittiTracking) -> Recording:
    root, name = root_of(Path(source.folder), "image_02"), f"{int(source.sequence):04d}"
    tables, poses = clip_poses(root, name)
    calibration = read_calibration(root / "calib" / f"{name}.txt", ("P2", "P3"))
    images = numbered_images(root / "image_02" / name, root / "image_03" / name)
    labels = (root / "label_02" / f"{name}.txt",)
    return assembled_recording(source, calibration, images, poses, labels, tables)


def _raw(source: parameters.LabelledFolder) -> Recording:
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
    calibration = read_calibration(cameras, PAIRS[1])
    images = numbered_images(root / "image_02/data", root / "image_03/data")
    poses = (*calibrations, *packets.values()) if packets else ()
    labels = (root / "tracklet_labels.xml", velodyne, cameras)
    return assembled_recording(source, calibration, images, poses, labels, Tables("kitti_raw"))


def _odometry(source: parameters.KittiOdometry) -> Recording:
    root = Path(source.folder)
    left, right = ("2", "3") if (root / "image_2").is_dir() else ("0", "1")
    calibration = read_calibration(root / "calib.txt", (f"P{left}", f"P{right}"))
    images = numbered_images(root / f"image_{left}", root / f"image_{right}")
    return assembled_recording(source, calibration, images, poses=(root / "poses.txt",))


def _pair_of_benchmark(source: parameters.KittiPair) -> Recording:
    root, name = root_of(Path(source.folder), "image_2", "image_0"), f"{int(source.sequence):06d}"
    for files, cameras in zip(BENCHMARKS, PAIRS, strict=True):
        left, right, calibration, *truth = (file and root / file.format(name) for file in files)
        # Or the JPEG that is in its place.
        left, right = (max(one.parent.glob(f"{one.stem}.*"), default=one) for one in (left, right))
        if left.is_file():
            existing = [file if file and file.is_file() else None for file in truth]
            calibrated = read_calibration(calibration, cameras)
            return assembled_pair(source, (left, right), calibrated, *existing)
    images = " or ".join(files[0].format(name) for files in BENCHMARKS)
    raise UserError(f"source.sequence: {root} has no {images}")


def _virtual(source: parameters.LabelledFolder) -> Recording:
    root = Path(source.folder)
    folders = (root / VIRTUAL_IMAGES / camera for camera in ("Camera_0", "Camera_1"))
    poses = (root / "extrinsic.txt",)
    calibration = virtual_kitti_tables.read_calibration(root / "intrinsic.txt", *poses)
    images = numbered_images(*folders, names=r"rgb_(\d{5})\.jpg", example="rgb_00000.jpg")
    labels = tuple(root / name for name in ("pose.txt", "bbox.txt", "info.txt"))
    return assembled_recording(source, calibration, images, poses, labels, Tables("virtual_kitti"))


def _argoverse(source: parameters.Argoverse) -> Recording:
    root = Path(source.folder)
    folder, cameras = root / LOG_IMAGES, argoverse.CAMERAS
    named = {"names": r"(\d{1,18})\.jpg", "example": "315966070549927216.jpg"}
    left, right = numbered_images(*(folder / name for name in cameras), **named)
    times, partners = tuple(left), pairs_by_time(list(left), list(right))
    if not partners:
        raise UserError(f"{folder}: no image of {cameras[1]} at a time of {cameras[0]}")
    names = (argoverse.ANNOTATIONS, argoverse.CITY, argoverse.SENSORS, argoverse.INTRINSICS)
    _, city, sensors, intrinsics = labels = tuple(root / name for name in names)
    of_right = {k: right[partners[time]] for k, time in enumerate(times) if time in partners}
    calibration = argoverse.read_calibration(intrinsics, sensors)
    images, poses = (dict(enumerate(left.values())), of_right), (city, sensors)
    tables = Tables("argoverse", times)
    recording = assembled_recording(source, calibration, images, poses, labels, tables)
    check_steps(recording, source.sample_time, root, "source")
    return recording


def _folder(source: parameters.LabelledFolder) -> Recording:
    root = Path(source.folder)
    calibration = read_rig(root / "rig.yaml")
    images = numbered_images(root / "left", root / "right")
    files = (root / "poses.txt",), (root / "labels.txt",)
    return assembled_recording(source, calibration, images, *files)


def _named_pair(source: parameters.Pair) -> Recording:
    images = Path(source.left), Path(source.right)
    calibration = read_named_calibration(Path(source.calibration))
    return assembled_pair(source, images, calibration, source.labels, source.disparity)


def assembled_recording(
    source: parameters.Recorded,
    calibration: Calibration,
    images: tuple[Images, Images],
    poses: tuple[Path, ...],
    labels: tuple[Path, ...] = (),
    tables: Tables | None = None,
) -> Recording:
    """The recording in these files, checked as far as the heads of the images.

    The frames are those that the images, the target's labels and the poses have. With the target
    `auto` every moving object is tracked.

    Args:
        source: the user's parameters.
        calibration: of the rig.
        images: of the left and the right camera.
        poses: files of the ego poses, which may be missing.
        labels: files of the labels, which may be missing if the source has no target.
        tables: how both are written; by default as KITTI's.
    """
    tables = tables or Tables()
    # One pair of images has no target: its labels are no tracks.
    named = getattr(source, "target", None)
    target = None if named == "auto" else named
    limits: dict[str, tuple[int, int]] = {}
    if target is not None:
        track = labels_of(labels, tables, target)
        limits[f"track {target}"] = (int(track.frames[0]), int(track.frames[-1]) + 1)
    pose_files = _existing(poses)
    if pose_files:
        limits["the ego poses"] = (0, len(read_poses(pose_files, tables)))
    frames = common_frames(source.frames, images[0], limits)
    of_target = {}
    if target is not None:
        if frames.start not in track.frames:
            raise UserError(
                f"source.frames: {labels[0]} has no label of track {target} in frame {frames.start}"
            )
        box = track.boxes[track.frames == frames.start][0]
        of_target = {"label": track.kind, "first_box": (float(box[0]), float(box[2]))}
    width, height = _common_size(frames, images, calibration.rectification)
    left, right = (tuple(files[number] for number in frames) for files in images)
    return Recording(
        layout=source.kind,
        frames=frames,
        left=left,
        right=right,
        width=width,
        height=height,
        calibration=calibration,
        tables=replace(tables, first=frames.start, left_camera=calibration.left_camera),
        pose_files=pose_files,
        label_files=_existing(labels),
        target=target,
        auto=named == "auto",
        **of_target,
    )


def assembled_pair(
    source: parameters.Recorded,
    images: tuple[Path, Path],
    calibration: Calibration,
    labels: Path | str | None,
    disparity: Path | str | None,
) -> Recording:
    """The recording of one pair of images, without time and motion, and their optional truth."""
    recording = assembled_recording(source, calibration, tuple({0: i} for i in images), poses=())
    truth = (() if name is None else (Path(name),) for name in (labels, disparity))
    label_files, true_disparities = truth
    for file in true_disparities:
        height, width = read_disparity(file).shape
        if (width, height) != (recording.width, recording.height):
            others = f"{images[0].name} has {recording.width} × {recording.height} px"
            raise UserError(f"{file}: {width} × {height} px, but {others}")
    return replace(recording, label_files=label_files, true_disparities=true_disparities)


def _existing(files: tuple[Path, ...]) -> tuple[Path, ...]:
    """All of these files, or () if one is missing."""
    return files if all(file.exists() for file in files) else ()


def numbered_images(
    *folders: Path, names: str = r"(\d{1,10})\.(?:png|jpe?g)", example: str = "000000.png"
) -> tuple[Images, ...]:
    """The images of each of the `folders` by the number in their name, in ascending order.

    `names` is the pattern of the files' names, its group is the number; `example` is such a name.
    """
    numbered = []
    for folder in folders:
        images = {}
        try:
            for i, file in enumerate(folder.iterdir()):
                if i >= MOST_FILES:
                    raise UserError(f"{folder}: more than {MOST_FILES} files")
                match = re.fullmatch(names, file.name, re.IGNORECASE)
                # A PNG before a JPEG of the same number, in whichever order the folder lists them.
                if match and file > images.get(int(match[1]), Path()):
                    images[int(match[1])] = file
        except FileNotFoundError:
            raise UserError(f"{folder}: no such folder") from None
        except OSError as error:
            raise UserError(f"{folder}: cannot be read: {error.strerror}") from error
        if not images:
            raise UserError(f"{folder}: has no images such as {example}")
        numbered.append(dict(sorted(images.items())))
    return tuple(numbered)


def _common_size(
    frames: range, images: tuple[Images, Images], rectification: Rectification | None
) -> tuple[int, int]:
    """Width and height in px of the rectified images of all `frames`."""
    first_of: dict[tuple[int, int], Path] = {}
    for number in frames:
        for files in images:
            if number not in files:
                folder = next(iter(files.values())).parent
                raise UserError(f"{folder}: the image of frame {number} is missing")
            first_of.setdefault(image_size(files[number]), files[number])
    expected, whose = next(iter(first_of)), "the images before have"
    if rectification is not None:
        expected, whose = rectification.file_size, "its calibration has"
    for size, file in first_of.items():
        if size != expected:
            found, other = (f"{width} × {height} px" for width, height in (size, expected))
            raise UserError(f"{file}: {found}, but {whose} {other}")
    return expected if rectification is None else rectification.size


LAYOUTS = (
    ("kitti_raw", _raw, ("image_02/data",)),
    ("kitti_tracking", _tracking, ("image_02",)),
    ("kitti_odometry", _odometry, ("image_0", "calib.txt")),
    ("kitti_pair", _pair_of_benchmark, ("image_2", "calib"), ("image_2", "calib_cam_to_cam"),
     ("image_0", "calib")),
    ("virtual_kitti", _virtual, (str(VIRTUAL_IMAGES),)),
    ("argoverse", _argoverse, (str(LOG_IMAGES),)),
    ("rosbag", rosbag.find_recording, (rosbag.METADATA,)),
    ("folder", _folder, ("rig.yaml",)),
    ("pair", _named_pair),
)  # fmt: skip
"""Each option of `source`, the function that finds its recording, and what a folder with it has,
itself or in its `training`: all of one of these."""
