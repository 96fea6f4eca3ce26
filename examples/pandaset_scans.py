"""Scans of one road user of PandaSet as tables for `stixel run measurement=file`.

PandaSet (Hesai and Scale AI, pandaset.org, CC BY 4.0) has a folder for each sequence, with the
points of its lidars and labelled boxes. With your own copy of one sequence:

    python examples/pandaset_scans.py SEQUENCE                # lists the road users that move
    python examples/pandaset_scans.py SEQUENCE UUID FOLDER    # writes the tables of one
    stixel run experiment=pandaset measurement.path=FOLDER/scans.csv \
        measurement.ego=FOLDER/ego.csv measurement.truth=FOLDER/truth.csv \
        measurement.road_z=Z                                  # Z is printed

A scan has the points of the rotating lidar within half a length + 3 m of the labelled centre, 0.35
to 2.2 m above the lowest of them, and of each bearing of 0.2° the nearest. So neighbours are in it,
too. PandaSet's files are pickles. They are read with a list of the types of a data frame; others
are refused.
"""

import csv
import gzip
import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.compat.pickle_compat import Unpickler

MARGIN, LOWEST, HIGHEST, BEARING = 3.0, 0.35, 2.2, np.radians(0.2)
"""m beyond half a length; m above the lowest point; rad."""

GREATEST = 2**29
"""Bytes of an unpacked file."""

ALLOWED = {
    *(("pandas", name) for name in ("DataFrame", "Index", "RangeIndex")),
    ("pandas.core.frame", "DataFrame"),
    ("pandas.core.internals.managers", "BlockManager"),
    ("pandas.core.internals.blocks", "new_block"),
    ("pandas._libs.internals", "_unpickle_block"),
    *(("pandas.core.indexes.base", name) for name in ("Index", "_new_Index")),
    ("pandas.core.indexes.range", "RangeIndex"),
    ("pandas.core.indexes.numeric", "Int64Index"),
    ("builtins", "slice"),
    ("builtins", "bytearray"),
    *(("numpy", name) for name in ("ndarray", "dtype")),
    *((f"numpy.{core}.multiarray", "_reconstruct") for core in ("core", "_core")),
    *((f"numpy.{core}.multiarray", "scalar") for core in ("core", "_core")),
    ("_codecs", "encode"),
}


class FrameUnpickler(Unpickler):
    """Reads data frames of numbers and texts, of old and new versions of pandas; nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """The type, if it is one of a data frame."""
        if (module, name) not in ALLOWED:
            raise ValueError(f"{module}.{name} is no part of a data frame")
        return super().find_class(module, name)


def read_frame(path: Path) -> pd.DataFrame:
    """The data frame of a file such as `lidar/00.pkl.gz`; exits with one line if it has none."""
    try:
        with gzip.open(path) as stream:
            content = stream.read(GREATEST + 1)
            if len(content) > GREATEST:
                raise ValueError(f"over {GREATEST} bytes")
        frame = FrameUnpickler(io.BytesIO(content)).load()
        if not isinstance(frame, pd.DataFrame):
            raise ValueError("is no data frame")
    except (OSError, EOFError, ValueError, TypeError, AttributeError, KeyError) as fault:
        sys.exit(f"{path}: {fault}")
    return frame


def heading_of(quaternion: dict[str, float]) -> float:
    """Heading of a sensor whose y axis points forward, rad."""
    w, x, y, z = (quaternion[name] for name in "wxyz")
    return float(np.arctan2(1.0 - 2.0 * (x * x + z * z), 2.0 * (x * y - w * z)))


def cuboids(sequence: Path) -> pd.DataFrame:
    """The labels of all frames; a label that two sensors see stands once."""
    frames = [
        read_frame(file).assign(k=k)
        for k, file in enumerate(sorted((sequence / "annotations/cuboids").glob("*.pkl.gz")))
    ]
    return pd.concat(frames, ignore_index=True).drop_duplicates(["k", "uuid"])


def moving(labels: pd.DataFrame) -> pd.DataFrame:
    """uuid, label, frames and the way, m, of what moves by more than 3 m."""
    groups = labels.groupby("uuid")
    ends = groups[["position.x", "position.y"]].agg(lambda values: values.iloc[-1] - values.iloc[0])
    way = np.hypot(ends["position.x"], ends["position.y"])
    table = pd.DataFrame({"label": groups["label"].first(), "frames": groups.size(), "way": way})
    return table[table["way"] > 3.0].sort_values("frames", ascending=False)


def scan(points: np.ndarray, sensor: np.ndarray, centre: np.ndarray, reach: float) -> np.ndarray:
    """The points (n, 3) m of a scan, of points (N, 3) m in the world: see the module's text."""
    near = points[np.hypot(*(points[:, :2] - centre).T) < reach]
    if not len(near):
        return near
    height = near[:, 2] - near[:, 2].min()
    near = near[(height >= LOWEST) & (height <= HIGHEST)]
    offsets = near[:, :2] - sensor
    bearings = np.round(np.arctan2(offsets[:, 1], offsets[:, 0]) / BEARING)
    order = np.argsort(np.hypot(*offsets.T), kind="stable")
    _, first = np.unique(bearings[order], return_index=True)
    return near[order][first]


def write(file: Path, columns: str, rows: list[tuple]) -> None:
    """Write a table."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns.split())
        writer.writerows(rows)


def main(sequence: Path, uuid: str, folder: Path) -> None:
    """Write `scans.csv`, `ego.csv` and `truth.csv` of the road user `uuid` into `folder`."""
    labels = cuboids(sequence)
    own = labels[labels["uuid"] == uuid].set_index("k")
    if own.empty:
        sys.exit(f"{sequence}: no label with the uuid {uuid}")
    length, width = own["dimensions.y"].median(), own["dimensions.x"].median()
    poses = json.loads((sequence / "lidar/poses.json").read_text("utf-8"))
    times = json.loads((sequence / "lidar/timestamps.json").read_text("utf-8"))
    scans, ego, truth = [], [], []
    for k in range(own.index.min(), own.index.max() + 1):
        place, t = poses[k]["position"], round(times[k] - times[own.index.min()], 6)
        sensor = np.array([place["x"], place["y"]])
        row = k - own.index.min()
        ego.append((row, t, *sensor, heading_of(poses[k]["heading"])))
        if k not in own.index:
            continue
        label = own.loc[k]
        centre = label[["position.x", "position.y"]].to_numpy(float)
        truth.append((row, *centre, label["yaw"] + 0.5 * np.pi, length, width))
        cloud = read_frame(sequence / f"lidar/{k:02d}.pkl.gz")
        points = cloud.loc[cloud["d"] == 0, ["x", "y", "z"]].to_numpy(float)
        for point in scan(points, sensor, centre, 0.5 * length + MARGIN):
            scans.append((row, t, *point))
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "scans.csv", "k t x y z", scans)
    write(folder / "ego.csv", "k t x y heading", ego)
    write(folder / "truth.csv", "k x y heading length width", truth)
    road = (own["position.z"] - 0.5 * own["dimensions.z"]).median()
    print(f"measurement.road_z={road:.2f}")


if __name__ == "__main__":
    if len(sys.argv) == 2:
        print(moving(cuboids(Path(sys.argv[1]))).to_string())
    elif len(sys.argv) == 4:
        main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
    else:
        sys.exit(__doc__)
