"""The rig in a calibration file, or in numbers under the names of other programs.

A file is a `rig.yaml` of ours, one of KITTI's, Middlebury's `calib.txt` (Scharstein et al. 2014:
`cam0=[f 0 cx; 0 f cy; 0 0 1]`, `cam1`, `baseline` in mm), the YAML of the right camera's
`CameraInfo` of ROS, whose P counts, or OpenCV's with the `P1` and `P2` of `stereoRectify`.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stixel_cli.border.files import read_text, read_yaml
from stixel_cli.errors import UserError, located, printable
from stixel_cli.geometry.rig import Rig
from stixel_cli.recordings import kitti_tables
from stixel_cli.recordings.types import ERROR_VALUES, Calibration

NEEDED = ("focal_length", "principal_u", "principal_v", "baseline")
OPTIONAL = ("focal_length_v", "principal_u_right", "camera_height")
SAME = {"fx": "focal_length", "fy": "focal_length_v", "cx": "principal_u", "cy": "principal_v"}
"""Our name for each accepted other name of a number."""

COUNTERPARTS = {
    "focal_length": ("f", "fu", "focal"),
    "principal_u": ("u0", "ppx"),
    "principal_v": ("v0", "ppy"),
    "principal_u_right": ("doffs", "cx1", "cx_right"),
    "baseline": ("b", "tx", "t"),
    "camera_height": ("h", "mounting_height"),
    "horizontal_fov": ("fov", "hfov"),
}
"""Names that other programs use for ours, in lower case; a message suggests ours."""


def our_names(given: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of a rig by our names: `fx`, `fy`, `cx`, `cy` and `K`, (3, 3), become ours.

    ValueError for a K that is not a camera matrix, or a number that is given twice.
    """
    pairs = [(SAME.get(name, name), value) for name, value in given.items() if name != "K"]
    if "K" in given:
        try:
            matrix = np.array(given["K"], dtype=np.float64).reshape(3, 3)
        except (TypeError, ValueError):
            raise ValueError("K: must be a camera matrix of 3 × 3 numbers") from None
        of_matrix = matrix[[0, 1, 0, 1], [0, 1, 2, 2]]  # f_x, f_y, c_x, c_y
        pairs += zip(SAME.values(), of_matrix.tolist(), strict=True)
    names = [name for name, _ in pairs]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ValueError(f"a number is given twice, by two of its names: {', '.join(twice)}")
    return dict(pairs)


def counterpart(name: str, known: Collection[str]) -> str:
    """`; did you mean …?` with ours of the `known` names, or else all of these."""
    meant = [ours for ours in known if name.lower() in COUNTERPARTS.get(ours, ())]
    return f"; did you mean {meant[0]}?" if meant else f"; it has {', '.join(known)}"


def read_named_calibration(file: Path) -> Calibration:
    """The calibration in a file of any of these kinds; UserError if it is not valid."""
    if file.suffix in (".yaml", ".yml"):
        return read_rig(file)
    if "cam0=" in read_text(file):
        return _middlebury(file)
    return kitti_tables.read_calibration(file, *kitti_tables.PAIRS)


def read_rig(file: Path) -> Calibration:
    """The calibration in a YAML file."""
    content = read_yaml(file)
    # Names of the projection in files of camera drivers, and as ROS 1 and ROS 2 print it.
    for name in {"projection_matrix", "P", "p"} & content.keys():
        right = _projection(file, name, content[name])
        if right[0, 3] == 0.0:
            raise UserError(f"{file}: {name} has no baseline: give the file of the right camera")
        left = right * [1.0, 1.0, 1.0, 0.0]
        return kitti_tables.rectified_pair(file, ("the left", "the right camera"), (left, right))
    if {"P1", "P2"} <= content.keys():
        pair = [_projection(file, name, content[name]) for name in ("P1", "P2")]
        return kitti_tables.rectified_pair(file, ("P1", "P2"), pair)
    with located(file):
        content = our_names(content)
    known = NEEDED + OPTIONAL + ERROR_VALUES
    for name, value in content.items():
        if name not in known:
            meant = counterpart(str(name), known)
            raise UserError(f"{file}: {printable(str(name))}: unknown{meant}")
        listed = value if name in ERROR_VALUES and isinstance(value, list) else [value]
        if any(isinstance(one, bool) or not isinstance(one, int | float) for one in listed):
            raise UserError(f"{file}: {name}: must be a number")
        if name in ERROR_VALUES and len(listed) != 3:
            raise UserError(f"{file}: {name}: must be three numbers, px")
        if name.startswith("focal_length") and value <= 0:
            raise UserError(f"{file}: {name}: must be > 0, got {value:g}")
    if missing := [name for name in NEEDED if name not in content]:
        raise UserError(f"{file}: missing: {', '.join(missing)}")
    kitti_tables.check_baseline(file, content["baseline"], "the left", "the right camera")
    content |= {name: tuple(content[name]) for name in ERROR_VALUES if name in content}
    absent = {"focal_length_v": content["focal_length"], "camera_height": None}
    return Calibration(**absent | content)


def rig_text(rig: Rig, comment: str) -> str:
    """A `rig.yaml` that `read_rig` reads, with a `comment` of one line."""
    values = {
        "focal_length": rig.focal,
        "focal_length_v": rig.focal_v,
        "principal_u": rig.u0,
        "principal_v": rig.v0,
        "principal_u_right": rig.u0_right,
        "baseline": rig.baseline,
        "camera_height": rig.camera_height,
        **{name: [*getattr(rig, name)] for name in ERROR_VALUES},
    }
    rows = [f"{name}: {value}\n" for name, value in values.items()]
    return "".join([f"# {comment}\n", *rows])


def _middlebury(file: Path) -> Calibration:
    """The calibration in a `calib.txt`; its `doffs` is the distance of both cameras' cx."""
    matrices = (kitti_tables.named_numbers(file, 9, name) for name in ("cam0", "cam1"))
    left, right = (np.reshape(numbers, (3, 3)) for numbers in matrices)
    # The baseline is in mm.
    moved = -1e-3 * kitti_tables.named_numbers(file, 1, "baseline")[0] * right[:, :1]
    pair = np.hstack([left, 0.0 * moved]), np.hstack([right, moved])
    return kitti_tables.rectified_pair(file, ("cam0", "cam1"), pair)


def _projection(file: Path, name: str, value: Any) -> np.ndarray:
    """The projection (3, 4) in `value`: its numbers, or a mapping that has them as `data`."""
    try:
        data = value["data"] if isinstance(value, dict) else value
        matrix = np.array(data, dtype=np.float64).reshape(3, 4)
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{file}: {name}: must have 12 numbers") from None
    if not (np.abs(matrix) < kitti_tables.GREATEST).all():
        raise UserError(f"{file}: {name}: numbers must be within ±{kitti_tables.GREATEST:g}")
    return matrix
