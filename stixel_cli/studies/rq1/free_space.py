"""RQ1's chapter on the occupancy grid and free space: grid and path, and the three grids."""

from collections.abc import Iterator, Sequence

from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.pool import Group, counts, grid, groups
from stixel_cli.studies.tables import with_ends
from stixel_cli.studies.types import Paragraph, Section, StudyData, Table

_COLUMNS = {
    "missed %": by_pose.COLUMN_MISSED,
    "below threshold %": by_pose.COLUMN_BELOW_THRESHOLD,
    "false positive %": by_pose.COLUMN_FALSE_POSITIVE,
    "bias px": by_pose.COLUMN_BIAS,
    "RMS px": by_pose.COLUMN_RMS,
    "bias m": by_pose.COLUMN_BIAS_M,
    "RMS m": by_pose.COLUMN_RMS_M,
}


def free_space_section(data: StudyData, users: Sequence[Group]) -> Section:
    """What the grid finds alone, what the path makes of it; the three grids."""
    grids = groups(data.sweeps["grids"], grid)

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
                f"metres; brackets: 95 % intervals over the poses; {counts(grids)}.",
                ("grid", "columns", "step", *with_ends(_COLUMNS)),
                tuple(_grid_rows(grids)),
            ),
        ),
    )


def _column_value(step: str, of: by_pose.Statistic) -> figures.Values:
    return by_pose.over_range(
        lambda group, low, high: by_pose.column_sums(group, step, low, high), of
    )


def _grid_rows(grids: Sequence[Group]) -> Iterator[tuple]:
    for group in grids:
        for where, of_target in (("of the target", True), ("all", False)):
            for step in ("grid", "path"):
                sums = by_pose.column_sums(group, step, of_target=of_target)
                yield (group.label, where, step, *by_pose.cells(group, sums, _COLUMNS))
