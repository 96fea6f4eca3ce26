"""Labels, ego poses and calibration of two tracks in KITTI's layout, without images."""

from dataclasses import replace

import numpy as np
from made_clip import HEIGHT, small_rig, small_scenario

from stixel_cli.export.export import labels_text, write_clip

SEQUENCE = "0003"


def make_motion(folder, count=12, labels=("Car", "Pedestrian"), left_out=()):
    """Write track 0 and, 3 m to its right, track 1; return the scenario of track 0."""
    scenario = small_scenario(count)
    right = scenario.target_poses_world + np.array([3.0, 0.0, 0.0])
    rig = small_rig()
    own = labels_text(scenario, rig, labels[0], HEIGHT)
    write_clip(folder, SEQUENCE, [], scenario, rig, own)
    file = folder / "label_02" / f"{SEQUENCE}.txt"
    rows = [row for row in file.read_text().splitlines() if int(row.split()[0]) not in left_out]
    other = labels_text(replace(scenario, target_poses_world=right), rig, labels[1], 1.7)
    rows += [row.replace(" 0 ", " 1 ", 1) for row in other.splitlines()]
    file.write_text("\n".join(rows) + "\n")
    return scenario
