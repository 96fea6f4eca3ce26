"""Errors of stixels at labelled cars: python bench/label_errors.py OVERRIDE …

The overrides are those of `stixel run` on a recording with labels. A label is that of a car that
is neither truncated nor occluded. Its error is the disparity of its stixels minus that of its box
where the ray of the stixel's middle column enters it, the median over the label's stixels. Nothing
that is measured depends on it: labels only check the rig's calibration.
"""

import sys

import numpy as np

from stixel_cli import compose
from stixel_cli.experiment.stages import computed_stages
from stixel_cli.recordings.tables import read_labels
from stixel_cli.scene.parameters import CLASS_OF_KITTI_TYPE
from stixel_cli.validation.pair_errors import label_face

GREATEST_ERROR = 3.0
"""A stixel farther from the label's face than this, px, is of another object."""

INNER = 0.7
"""Share of the columns of a label that is used: at its sides a stixel may be of the background."""

LEAST_STIXELS = 3
"""Per label."""


def label_errors(stixels, recording, rig):
    """Frame, track, column px, depth m and error px of all labels, one row each."""
    tables = recording.tables
    cars = {
        track: one
        for track, one in read_labels(recording.label_files, tables).items()
        if CLASS_OF_KITTI_TYPE.get(one.kind) == "car"
    }
    rows = []
    for chunk in stixels:
        for i in range(len(chunk.offsets) - 1):
            number = tables.first + chunk.first + i
            for track, labels in cars.items():
                for row in np.flatnonzero(labels.frames == number):
                    if labels.truncated[row] or labels.occluded[row]:
                        continue
                    face = label_face(labels, row, rig, tables.left_camera)
                    found = one_label(chunk, chunk.rows(i), face, rig)
                    rows += [] if found is None else [(number, track, *found)]
    return np.array(rows, dtype=float).reshape(-1, 5)


def one_label(chunk, rows, face, rig):
    """Column px, depth m and error px at one label; None with too few stixels."""
    seen = np.flatnonzero(np.isfinite(face))
    if len(seen) == 0:
        return None
    margin = 0.5 * (1.0 - INNER) * (seen[-1] - seen[0] + 1)
    columns = (chunk.left[rows] + chunk.right[rows] - 1) // 2
    inside = (columns >= seen[0] + margin) & (columns <= seen[-1] - margin)
    columns, measured = columns[inside], chunk.disparity[rows][inside]
    depths = face[columns]
    errors = measured - rig.disparity_from_depth(depths)
    near = np.abs(errors) <= GREATEST_ERROR
    if near.sum() < LEAST_STIXELS:
        return None
    return np.median(columns[near]), np.median(depths[near]), np.median(errors[near])


def main(overrides):
    """Print one line per labelled car."""
    composition = compose([*overrides, "source.target=auto", "road_user=car"])
    with computed_stages(composition, ["stixels"]) as (_, load):
        rows = label_errors(load("stixels"), composition.recording, composition.configuration.rig)
    for track in np.unique(rows[:, 1]):
        own = rows[rows[:, 1] == track]
        columns, depths = own[:, 2], own[:, 3]
        print(
            f"car {track:.0f}: {len(own)} labels at {depths.min():.0f} to {depths.max():.0f} m, "
            f"columns {columns.min():.0f} to {columns.max():.0f}: median error "
            f"{np.median(own[:, 4]):+.2f} px"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
