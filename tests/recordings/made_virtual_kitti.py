"""A small look-alike of Virtual KITTI 2, made from one of KITTI tracking's clips."""

import cv2
import numpy as np

from stixel_cli.recordings.kitti_tables import read_labels, read_poses

POSE = (
    "frame cameraID trackID alpha width height length world_space_X world_space_Y world_space_Z "
    "rotation_world_space_y rotation_world_space_x rotation_world_space_z camera_space_X "
    "camera_space_Y camera_space_Z rotation_camera_space_y rotation_camera_space_x "
    "rotation_camera_space_z"
)
BOX = (
    "frame cameraID trackID left right top bottom number_pixels truncation_ratio occupancy_ratio "
    "isMoving"
)


def make_variation(clip, folder, baseline=0.5, sequence="0003"):
    """Write the files of `clip`, in KITTI tracking's layout, in that of Virtual KITTI 2."""
    for i in (0, 1):
        images = folder / f"frames/rgb/Camera_{i}"
        images.mkdir(parents=True)
        for file in sorted((clip / f"image_0{2 + i}" / sequence).iterdir()):
            grey = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
            colour = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
            cv2.imwrite(str(images / f"rgb_{int(file.stem):05d}.jpg"), colour)
    poses = read_poses(clip / "ego_poses" / f"{sequence}.txt")
    extrinsic, intrinsic = ["frame cameraID r1,1 …"], ["frame cameraID K[0,0] K[1,1] …"]
    # Any world: its axes and its origin are not those of the first camera.
    world = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    world *= np.linalg.det(world)
    for k, pose in enumerate(poses):
        turn = world @ pose[:, :3]
        for i in (0, 1):
            place = world @ (pose[:, 3] + pose[:, 0] * baseline * i) + (100.0, -7.0, 3.0)
            rows = np.vstack([np.column_stack([turn.T, -turn.T @ place]), [0, 0, 0, 1]])
            extrinsic.append(" ".join(map(repr, [k, i, *map(float, rows.ravel())])))
            intrinsic.append(f"{k} {i} 150 150 78 40")
    pose, box = [POSE], [BOX]
    (labels,) = read_labels(clip / "label_02" / f"{sequence}.txt").values()
    for row, k in enumerate(labels.frames):
        height, width, length = labels.sizes[row]
        left, top, right, bottom = labels.boxes[row]
        x, y, z = labels.places[row]
        for i in (0, 1):
            pose.append(
                f"{k} {i} 4 0 {width} {height} {length} 0 0 0 0 0 0 {x - baseline * i} {y} {z} "
                f"{labels.yaws[row]} 0 0"
            )
            box.append(f"{k} {i} 4 {left} {right} {top} {bottom} 900 0 0.85 True")
    info = ["trackID label model color", "4 Car Sedan4Door Black"]
    for name, lines in (
        ("extrinsic", extrinsic),
        ("intrinsic", intrinsic),
        ("pose", pose),
        ("bbox", box),
        ("info", info),
    ):
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
