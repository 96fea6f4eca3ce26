"""RQ1's chapter on the contrast of the paint."""

from collections.abc import Callable
from itertools import chain

import numpy as np

from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import cover_sums, estimate, pixel_sums, stixel_sums
from stixel_cli.studies.rq1.pool import EDGES, Group, by_label, contrast, counts, pool, road_user
from stixel_cli.studies.types import Paragraph, Section, StudyData, StudySweep, Table

INSIDE = 0


def contrast_section(data: StudyData) -> Section:
    """What the texture of the paint does to disparities and stixels."""
    lines = contrast_lines(data.sweeps["contrast"])

    def of(sums: Callable[..., np.ndarray], statistic: by_pose.Statistic, *zone: int):
        return lambda group: estimate(group, sums(group, *zone, EDGES[0], EDGES[-1]), statistic)

    panels = [
        ("Density inside the target", "share", of(pixel_sums, by_pose.PIXEL_DENSITY, INSIDE)),
        ("Disparity RMS inside the target", "px", of(pixel_sums, by_pose.PIXEL_RMS, INSIDE)),
        ("RMS of the stixels in disparity", "px", of(stixel_sums, by_pose.STIXEL_RMS_PX)),
        ("Columns in no stixel", "share", of(cover_sums, by_pose.UNCOVERED)),
    ]
    rows = []
    for label, found in lines.items():
        for at, group in found:
            estimates = [(value(group), unit) for _, unit, value in panels]
            cells = (e.scaled(100.0 if unit == "share" else 1.0).cells for e, unit in estimates)
            rows.append((label, at, *chain.from_iterable(cells)))
    told = counts(group for found in lines.values() for _, group in found)
    return Section(
        "Contrast of the paint",
        (
            Paragraph(
                "Stereo lives on texture. The contrast of paint and cloth is changed, light and "
                "background stay; all ranges together, default rig and matcher."
            ),
            figures.over_contrast(
                "contrast",
                "Disparities and stixels over the paint's contrast. Bands: 95 % intervals; "
                f"{told}.",
                lines,
                panels,
            ),
            Table(
                "contrast",
                f"The same as numbers; brackets: 95 % intervals over the poses; {told}.",
                (
                    "road user",
                    "contrast",
                    "density %",
                    "low density",
                    "high density",
                    "disparity RMS px",
                    "low disparity",
                    "high disparity",
                    "stixel RMS px",
                    "low stixel",
                    "high stixel",
                    "columns in no stixel %",
                    "low columns",
                    "high columns",
                ),
                tuple(rows),
            ),
        ),
    )


def contrast_lines(sweep: StudySweep) -> dict[str, list[tuple[float, Group]]]:
    """For each road user the contrasts, ascending, with what they gave."""
    return {
        label: sorted(
            ((at, pool(label, same)) for at, same in by_label(points, contrast).items()),
            key=lambda pair: pair[0],
        )
        for label, points in by_label(sweep.runs, road_user).items()
    }
