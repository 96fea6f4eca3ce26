"""RQ1's chapter on the occupancy grid and free space: grid and path, and the three grids."""

from collections.abc import Iterator, Sequence

import numpy as np

from stixel_cli.evaluation.stage_summary import column_summary
from stixel_cli.studies.nouns import Paragraph, Section, StudyData, Table
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1.pool import LEAST, Group, cell, grid, groups


def free_space_section(data: StudyData, users: Sequence[Group]) -> Section:
    """What the grid finds alone, what the path makes of it; the three grids."""
    grids = groups(data.parts["grids"], grid)

    def panels(kinds: dict[str, str]):
        return [
            (title, unit, {what: _column_value(step, name) for what, step in kinds.items()})
            for title, unit, name in (
                ("Bias", "px", "bias"),
                ("RMS", "px", "rms"),
                ("RMS in depth", "m", "rms_m"),
                ("Columns missed", "share", "missed"),
            )
        ]

    return Section(
        "Occupancy grid and free space",
        (
            Paragraph(
                "The grid alone is the cheapest cell of each column by itself; the path adds the "
                "ties to neighbouring columns and to the last frame (Badino, Franke, Mester 2007). "
                "The nearest obstacle's depth is that of its nearest surface; a slanted or stepped "
                "face votes for what lies behind it as well, which shows as a bias towards farther "
                "(smaller disparity) near the camera."
            ),
            figures.over_range(
                "free_space",
                "The target's columns over range, the grid's own choice (full) and the path's "
                "(dashed); default rig, polar grid.",
                users,
                panels({"grid": "grid", "path": "path"}),
            ),
            figures.over_range(
                "grids",
                "The three grids: the target's columns over range, all road users, after the path.",
                grids,
                panels({"": "path"}),
            ),
            Table(
                "grids",
                "Columns at all ranges. “All” are the columns of the whole image.",
                (
                    "grid",
                    "columns",
                    "step",
                    "missed %",
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


def _column_value(step: str, name: str) -> figures.Values:
    def value(group: Group, low: float, high: float) -> float:
        found = _columns(group, step, group.frames(low, high)[:, None])
        return found[name] if found["columns"] >= LEAST else float("nan")

    return value


def _columns(group: Group, step: str, frames, of_target: bool = True) -> dict[str, float]:
    columns = group.errors.columns
    chosen = frames & (columns.of_target if of_target else np.ones_like(columns.of_target))
    return column_summary(columns.true[chosen], getattr(columns, step)[chosen], group.rig)


def _grid_rows(grids: Sequence[Group]) -> Iterator[tuple]:
    for group in grids:
        for where, of_target in (("of the target", True), ("all", False)):
            for step in ("grid", "path"):
                found = _columns(group, step, group.seen[:, None], of_target)
                yield (
                    group.label,
                    where,
                    step,
                    cell(found["missed"], 100.0),
                    cell(found["invented"], 100.0),
                    *(cell(found[name]) for name in ("bias", "rms", "bias_m", "rms_m")),
                )
