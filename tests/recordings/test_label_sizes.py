"""The sizes of cars that recordings assume, against KITTI's labels."""

import numpy as np
import pytest
from real_data import real_data

from stixel_cli.config.folders import values_beside_groups
from stixel_cli.recordings.kitti_tables import read_labels
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE


def test_the_sizes_of_cars_are_those_of_the_labels():
    files = sorted((real_data("kitti_tracking") / "training" / "label_02").glob("*.txt"))
    labels = [one for f in files if f.stem != "0005" for one in read_labels(f).values()]
    cars = [one for one in labels if CLASS_OF_KITTI_TYPE.get(one.kind) == "car"]
    sizes = np.array([one.sizes[-1, [2, 1]] for one in cars])
    mean, std = sizes.mean(axis=0), sizes.std(axis=0)
    print(f"\n{len(sizes)} cars and vans: {mean} m, relative standard deviations {std / mean}")
    values = [one["set"] for one in values_beside_groups("recorded")["source"]["values"]]
    (assumed,) = (one for one in values if "prior.length" in one)
    found = dict(zip(assumed, [*mean, *(std / mean)], strict=True))
    assert found == pytest.approx(assumed, abs=5e-3)
