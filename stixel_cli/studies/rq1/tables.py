"""RQ1: the tables of the chapters."""

from collections.abc import Iterator, Mapping, Sequence

from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import cells, estimate
from stixel_cli.studies.rq1.pool import (
    AT_BORDER,
    COARSE,
    DEPTHS,
    EDGES,
    INSIDE,
    ROUND,
    SW_DEPTH,
    SW_STD,
    Group,
    cell,
    locking_swing,
    needed_disparity,
)
from stixel_cli.studies.tables import interval_columns, with_ends
from stixel_cli.studies.types import Table
from stixel_cli.validation.stage_errors import ZONES
from stixel_cli.validation.stage_summary import disparity_summary, stixel_summary

_OF_PIXELS = {
    "density %": by_pose.PIXEL_DENSITY,
    "gross %": by_pose.PIXEL_GROSS,
    "bias px": by_pose.pixel_bias,
    "RMS px": by_pose.PIXEL_RMS,
}
_PIXEL_COLUMNS = ("pixels", *with_ends(_OF_PIXELS), "median px")
_OF_MATCHED = {"stixel RMS px": by_pose.STIXEL_RMS_PX, "stixel RMS m": by_pose.STIXEL_RMS}
_OF_COVER = {"columns in no stixel %": by_pose.UNCOVERED}
_OF_COLUMNS = {
    "missed %": by_pose.COLUMN_MISSED,
    "below threshold %": by_pose.COLUMN_BELOW_THRESHOLD,
    "false positive %": by_pose.COLUMN_FALSE_POSITIVE,
    "bias px": by_pose.COLUMN_BIAS,
    "RMS px": by_pose.COLUMN_RMS,
    "bias m": by_pose.COLUMN_BIAS_M,
    "RMS m": by_pose.COLUMN_RMS_M,
}
_OF_HEIGHT = {
    "top bias px": by_pose.TOP_BIAS,
    "top RMS px": by_pose.TOP_RMS,
    "base bias px": by_pose.BASE_BIAS,
    "base RMS px": by_pose.BASE_RMS,
    "height bias m": by_pose.HEIGHT_BIAS,
    "height RMS m": by_pose.HEIGHT_RMS,
}
_OF_DEPTH = {
    "front face bias m": by_pose.STIXEL_BIAS,
    "front face RMS m": by_pose.STIXEL_RMS,
    "own pixels, square, bias m": by_pose.SQUARE_BIAS,
    "own pixels, square, RMS m": by_pose.SQUARE_RMS,
    "own pixels, slanted, bias m": by_pose.SLANTED_BIAS,
    "own pixels, slanted, RMS m": by_pose.SLANTED_RMS,
}
_OF_OWN = {name: of for name, of in _OF_DEPTH.items() if name.startswith("own")}
_OF_GROSS = {"gross %": by_pose.STIXEL_GROSS}
_OF_STIXELS = {
    **_OF_DEPTH,
    "error²/σ²": by_pose.NEES,
    "within σ %": by_pose.WITHIN_1,
    "lateral RMS m": by_pose.LATERAL_RMS,
}
_AT_DEPTH = {**_OF_DEPTH, "height bias m": by_pose.HEIGHT_BIAS, "error²/σ²": by_pose.NEES}
_OF_WIDTH = {"width in no stixel %": by_pose.UNSEEN}
_BY_RANGE = ("road user", "range m", "poses", "stixels")


def disparity_table(users: Sequence[Group]) -> Table:
    """Disparity on each road user, by zone and range."""
    rows = []
    for group in users:
        for zone in (INSIDE, AT_BORDER):
            for low, high in COARSE:
                poses = _poses(group, by_pose.pixel_sums(group, zone, low, high))
                where = ZONES[zone].rpartition(" ")[2]
                own = _pixel_cells(group, zone, low, high)
                rows.append((group.label, where, f"{low:g}–{high:g}", poses, *own))
    columns = ("road user", "zone", "range m", "poses", *_PIXEL_COLUMNS)
    return Table("disparity", "", columns, tuple(rows))


def matcher_table(matchers: Sequence[Group]) -> Table:
    """Disparity and stixels at all ranges, by matcher."""
    rows = [
        (
            group.label,
            *_pixel_cells(group, INSIDE, EDGES[0], EDGES[-1]),
            cell(locking_swing(group, INSIDE)),
            *cells(group, by_pose.stixel_sums(group, EDGES[0], EDGES[-1]), _OF_MATCHED),
            *cells(group, by_pose.cover_sums(group), _OF_COVER),
        )
        for group in matchers
    ]
    own = with_ends((*_OF_MATCHED, *_OF_COVER))
    return Table("matchers", "", ("matcher", *_PIXEL_COLUMNS, "locking px", *own), tuple(rows))


def _pixel_cells(group: Group, zone: int, low: float, high: float) -> Iterator[float | None]:
    """The cells of `_PIXEL_COLUMNS`."""
    sums = by_pose.pixel_sums(group, zone, low, high)
    yield int(sums[:, 0].sum())
    yield from cells(group, sums, _OF_PIXELS)
    yield cell(disparity_summary(group.errors.disparity, group.frames(low, high), zone)["median"])


def grid_table(grids: Sequence[Group]) -> Table:
    """Columns of the grids, of the target and all, before and after the path."""
    rows = []
    for group in grids:
        for where, of_target in (("of the target", True), ("all", False)):
            for step in ("grid", "path"):
                sums = by_pose.column_sums(group, step, of_target=of_target)
                rows.append((group.label, where, step, *cells(group, sums, _OF_COLUMNS)))
    columns = ("grid", "columns", "step", *with_ends(_OF_COLUMNS))
    return Table("grids", "", columns, tuple(rows))


def height_table(users: Sequence[Group]) -> Table:
    """Rows and height of the stixels on each road user, by range."""
    rows = [
        (*begin, *cells(group, by_pose.stixel_sums(group, low, high), _OF_HEIGHT))
        for group, low, high, begin in _by_range(users)
    ]
    return Table("height", "", (*_BY_RANGE, *with_ends(_OF_HEIGHT)), tuple(rows))


def stixel_table(users: Sequence[Group]) -> Table:
    """Depth, lateral error and stated std of the stixels on each road user, by range."""
    rows = [
        (
            *begin,
            *cells(group, by_pose.gross_sums(group, low, high), _OF_GROSS),
            *cells(group, by_pose.stixel_sums(group, low, high), _OF_STIXELS),
            cell(stixel_summary(group.errors.stixels, low, high)["sigma"]),
        )
        for group, low, high, begin in _by_range(users)
    ]
    columns = (*_BY_RANGE, *with_ends((*_OF_GROSS, *_OF_STIXELS)), "stated σ m")
    return Table("stixels", "", columns, tuple(rows))


def _by_range(users: Sequence[Group]) -> Iterator[tuple[Group, float, float, tuple]]:
    """Each road user and range, and the cells of `_BY_RANGE`."""
    for group in users:
        for low, high in COARSE:
            sums = by_pose.gross_sums(group, low, high)
            begin = (group.label, f"{low:g}–{high:g}", _poses(group, sums), int(sums[:, 0].sum()))
            yield group, low, high, begin


def rig_table(rigs: Sequence[Group]) -> Table:
    """Stixels of each rig against the std that The Stixel World states."""
    rows = []
    for group in rigs:
        near = by_pose.stixel_sums(group, *ROUND)
        found = stixel_summary(group.errors.stixels, *ROUND)
        needed = needed_disparity(group.rig, SW_STD, SW_DEPTH)
        rows.append(
            (
                group.label,
                f"{group.rig.width} × {group.rig.height}",
                float(group.rig.focal),
                float(group.rig.baseline),
                float(group.rig.disparity_from_depth(SW_DEPTH)),
                needed,
                *estimate(group, near, by_pose.STIXEL_RMS_PX).cells,
                cell(found["rms_px"] / needed),
                *estimate(group, near, by_pose.STIXEL_BIAS).cells,
                *estimate(group, near, by_pose.STIXEL_RMS).cells,
                *cells(group, near, _OF_OWN),
                _poses(group, near),
                int(found["stixels"]),
            )
        )
    columns = (
        *("rig", "image px", "f px", "B m", "disparity there px", "needed px"),
        *interval_columns("achieved RMS px", "RMS px"),
        "achieved / needed",
        *interval_columns("front face bias m", "bias"),
        *interval_columns("front face RMS m", "RMS m"),
        *with_ends(_OF_OWN),
        *("poses", "stixels"),
    )
    return Table("rigs", "", columns, tuple(rows))


def depth_table(rigs: Mapping[str, Sequence[Group]]) -> Table:
    """Stixels of each rig and road user at `DEPTHS`; `rigs` has the groups of a rig by user."""
    rows = []
    for rig, groups in rigs.items():
        for group in groups:
            for depth, ends in DEPTHS.items():
                sums = by_pose.stixel_sums(group, *ends)
                begin = (rig, group.label, depth, _poses(group, sums), int(sums[:, 0].sum()))
                width = cells(group, by_pose.cover_sums(group, *ends), _OF_WIDTH)
                rows.append((*begin, *cells(group, sums, _AT_DEPTH), *width))
    own = with_ends((*_AT_DEPTH, *_OF_WIDTH))
    columns = ("rig", "road user", "depth m", "poses", "stixels", *own)
    return Table("depths", "", columns, tuple(rows))


def _poses(group: Group, sums) -> int:
    """Number of poses whose first sum is not 0."""
    return len(set(group.poses[sums[:, 0] > 0.0].tolist()))


def contrast_table(lines: dict[str, list[tuple[float, Group]]]) -> Table:
    """Disparity and stixels of each road user by the contrast of its paint, at all ranges."""
    rows = []
    for label, found in lines.items():
        for contrast, group in found:
            pixels = by_pose.pixel_sums(group, INSIDE)
            stixels = by_pose.stixel_sums(group, EDGES[0], EDGES[-1])
            uncovered = estimate(group, by_pose.cover_sums(group), by_pose.UNCOVERED)
            rows.append(
                (
                    label,
                    contrast,
                    *estimate(group, pixels, by_pose.PIXEL_DENSITY).scaled(100.0).cells,
                    *estimate(group, pixels, by_pose.PIXEL_RMS).cells,
                    *estimate(group, stixels, by_pose.STIXEL_RMS_PX).cells,
                    *uncovered.scaled(100.0).cells,
                )
            )
    columns = (
        *("road user", "contrast"),
        *interval_columns("density %", "density"),
        *interval_columns("disparity RMS px", "disparity"),
        *interval_columns("stixel RMS px", "stixel"),
        *interval_columns("columns in no stixel %", "columns"),
    )
    return Table("contrast", "", columns, tuple(rows))
