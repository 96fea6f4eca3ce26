"""RQ1's chapter on the contrast of the paint."""

from collections.abc import Callable

from stixel_cli.evaluation.stage_summary import coverage_summary, disparity_summary, stixel_summary
from stixel_cli.studies.nouns import Paragraph, Part, Section, StudyData, Table
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1.pool import EDGES, Group, by_label, cell, contrast, pool, road_user

INSIDE = 0


def contrast_section(data: StudyData) -> Section:
    """What the texture of the paint does to disparities and stixels."""
    lines = contrast_lines(data.parts["contrast"])

    def pixels(name: str) -> Callable[[Group], float]:
        return lambda group: disparity_summary(group.errors.disparity, group.seen, INSIDE)[name]

    panels = [
        ("Density inside the target", "share", pixels("density")),
        ("Disparity RMS inside the target", "px", pixels("rms")),
        (
            "RMS of the stixels in disparity",
            "px",
            lambda g: stixel_summary(g.errors.stixels, EDGES[0], EDGES[-1])["rms_px"],
        ),
        (
            "Columns in no stixel",
            "share",
            lambda g: coverage_summary(g.errors.stixels, g.seen)["missed"],
        ),
    ]
    rows = [
        (label, at, *(cell(value(group)) for _, _, value in panels))
        for label, found in lines.items()
        for at, group in found
    ]
    return Section(
        "Contrast of the paint",
        (
            Paragraph(
                "Stereo lives on texture. The contrast of paint and cloth is changed, light and "
                "background stay; all ranges together, default rig and matcher."
            ),
            figures.over_contrast(
                "contrast", "Disparities and stixels over the paint's contrast.", lines, panels
            ),
            Table(
                "contrast",
                "The same as numbers.",
                (
                    "road user",
                    "contrast",
                    "density",
                    "disparity RMS px",
                    "stixel RMS px",
                    "columns in no stixel",
                ),
                tuple(rows),
            ),
        ),
    )


def contrast_lines(part: Part) -> dict[str, list[tuple[float, Group]]]:
    """For each road user the contrasts, ascending, with what they gave."""
    return {
        label: sorted(
            ((at, pool(label, same)) for at, same in by_label(points, contrast).items()),
            key=lambda pair: pair[0],
        )
        for label, points in by_label(part.points, road_user).items()
    }
