"""RQ1's chapter on the occupancy grid and free space: grid and path, and the three grids."""

from collections.abc import Iterator, Sequence

import numpy as np

from stixel_cli.evaluation.stage_summary import column_summary
from stixel_cli.studies.nouns import Paragraph, Section, StudyData, Table
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.pool import Group, cell, counts, grid, groups


def free_space_section(data: StudyData, users: Sequence[Group]) -> Section:
    """What the grid finds alone, what the path makes of it; the three grids."""
    grids = groups(data.parts["grids"], grid)

    def panels(kinds: dict[str, str]):
        return [
            (title, unit, {what: _column_value(step, of) for what, step in kinds.items()})
            for title, unit, of in (
                ("Bias", "px", by_pose.COLUMN_BIAS),
                ("RMS", "px", by_pose.COLUMN_RMS),
                ("RMS in depth", "m", by_pose.COLUMN_RMS_M),
                ("Columns missed", "share", by_pose.COLUMN_MISSED),
            )
        ]

    return Section(
        "Occupancy grid and free space",
        (
            Paragraph(
                "The grid alone is the cheapest cell of each column by itself; the path adds the "
                "ties to neighbouring columns and to the last frame (Badino, Franke, Mester 2007). "
                "The nearest obstacle's depth is that of its nearest surface; a slanted or stepped "
                "face can vote for what lies behind it as well, which would show as a bias towards "
                "farther (smaller disparity) near the camera, and least for who is narrow."
            ),
            figures.over_range(
                "free_space",
                "The target's columns over range, the path's choice (full) and the grid's own "
                "(dashed); default rig, polar grid. Bands: 95 % intervals of the path's; "
                f"{counts(users)}.",
                users,
                panels({"path": "path", "grid": "grid"}),
            ),
            figures.over_range(
                "grids",
                "The three grids: the target's columns over range, all road users, after the path. "
                f"Bands: 95 % intervals; {counts(grids)}.",
                grids,
                panels({"": "path"}),
            ),
            Table(
                "grids",
                "Columns at all ranges. “All” are those of the whole image, with the street's "
                "houses and trees up to the grid's far end, where one pixel of disparity is many "
                f"metres; {counts(grids)}.",
                (
                    "grid",
                    "columns",
                    "step",
                    "missed %",
                    "not asked for %",
                    "invented %",
                    "bias px",
                    "RMS px",
                    "bias m",
                    "RMS m",
                ),
                tuple(_grid_rows(grids)),
            ),
        ),
    )


def _column_value(step: str, of: by_pose.Statistic) -> figures.Values:
    return by_pose.over_range(
        lambda group, low, high: by_pose.column_sums(group, step, low, high), of
    )


def _columns(group: Group, step: str, frames, of_target: bool = True) -> dict[str, float]:
    columns = group.errors.columns
    chosen = frames & (columns.of_target if of_target else np.ones_like(columns.of_target))
    found, there = (getattr(columns, name)[chosen] for name in (step, f"{step}_there"))
    return column_summary(columns.true[chosen], found, there, group.rig)


def _grid_rows(grids: Sequence[Group]) -> Iterator[tuple]:
    for group in grids:
        for where, of_target in (("of the target", True), ("all", False)):
            for step in ("grid", "path"):
                found = _columns(group, step, group.seen[:, None], of_target)
                yield (
                    group.label,
                    where,
                    step,
                    *(cell(found[name], 100.0) for name in ("missed", "unasked", "invented")),
                    *(cell(found[name]) for name in ("bias", "rms", "bias_m", "rms_m")),
                )
