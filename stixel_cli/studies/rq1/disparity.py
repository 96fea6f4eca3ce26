"""RQ1's chapter on disparity: over range, by matcher, and the locking to whole pixels."""

from collections.abc import Iterator, Sequence

from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.pool import (
    COARSE,
    EDGES,
    Group,
    cell,
    counts,
    groups,
    locking_swing,
    matcher,
    seeds,
)
from stixel_cli.studies.tables import with_ends
from stixel_cli.studies.types import Section, StudyData, Table
from stixel_cli.validation.stage_errors import ZONES
from stixel_cli.validation.stage_summary import disparity_summary

INSIDE, BORDER = 0, 1
_COLUMNS = {
    "density %": by_pose.PIXEL_DENSITY,
    "gross %": by_pose.PIXEL_GROSS,
    "bias px": by_pose.pixel_bias,
    "RMS px": by_pose.PIXEL_RMS,
}
_OF_STIXELS = {
    "stixel RMS px": by_pose.STIXEL_RMS_PX,
    "stixel RMS m": by_pose.STIXEL_RMS,
}
_OF_COVER = {"columns in no stixel %": by_pose.UNCOVERED}


def disparity_section(data: StudyData, users: Sequence[Group]) -> Section:
    """Bias, RMS, gross share and density over range, pixel locking, SGM against BM."""
    matchers = groups(data.sweeps["matchers"], matcher)

    def of(zone: int, value: by_pose.Statistic) -> figures.Values:
        return by_pose.over_range(
            lambda group, low, high: by_pose.pixel_sums(group, zone, low, high), value
        )

    both = {"inside": INSIDE, "border": BORDER}
    panels = [
        (title, unit, {where: of(zone, value) for where, zone in both.items()})
        for title, unit, value in (
            ("Bias", "px", by_pose.pixel_bias),
            ("RMS", "px", by_pose.PIXEL_RMS),
            ("Gross share", "share", by_pose.PIXEL_GROSS),
            ("Density", "share", by_pose.PIXEL_DENSITY),
        )
    ]
    inside = [(title, unit, {"": drawn["inside"]}) for title, unit, drawn in panels]
    columns = ("pixels", *with_ends(_COLUMNS), "median px")
    return Section(
        "Disparity",
        (
            figures.over_range(
                "disparity",
                "Disparity on the target over range, inside it (full) and within its border "
                "(dashed); default rig, semi-global matching. Bands: 95 % intervals inside it; "
                f"{counts(users)}.",
                users,
                panels,
            ),
            Table(
                "disparity",
                "Disparity on the target, default rig, semi-global matching. Pixels are counted "
                f"in every seed: {seeds(users)}. Brackets: 95 % intervals over the poses. The "
                "median is of all pixels with a disparity, gross errors among them.",
                ("road user", "zone", "range m", "poses", *columns),
                tuple(_disparity_rows(users)),
            ),
            Section(
                "Semi-global against block matching",
                (
                    figures.over_range(
                        "matchers",
                        "Disparity inside the target over range, all road users, by matcher. "
                        "“One match” is without the second match that cancels the locking. Bands: "
                        f"95 % intervals; {counts(matchers)}.",
                        matchers,
                        inside,
                    ),
                    figures.locking(
                        "locking",
                        "Pixel locking: the mean error by the fractional part of the true "
                        "disparity. A matcher that locks to whole pixels errs downwards before "
                        "one half and upwards after it. Every frame of every road user; bands: "
                        "95 % intervals over the poses.",
                        matchers,
                        {"inside the target": 0, "inside other obstacles": 2},
                    ),
                    Table(
                        "matchers",
                        "All road users and ranges, by matcher; locking is the greatest less the "
                        "least mean error over the fraction. The stixels' columns are of the same "
                        "frames, gross errors left out; the median is of all disparities. "
                        f"Brackets: 95 % intervals over the poses; {counts(matchers)}.",
                        (
                            "matcher",
                            *columns,
                            "locking px",
                            *with_ends((*_OF_STIXELS, *_OF_COVER)),
                        ),
                        tuple(_matcher_rows(matchers)),
                    ),
                ),
            ),
        ),
    )


def _pixel_cells(group: Group, zone: int, low: float, high: float) -> Iterator[float | None]:
    """Pixels, what `_COLUMNS` names with its ends, and the median."""
    sums = by_pose.pixel_sums(group, zone, low, high)
    yield int(sums[:, 0].sum())
    yield from by_pose.cells(group, sums, _COLUMNS)
    yield cell(disparity_summary(group.errors.disparity, group.frames(low, high), zone)["median"])


def _disparity_rows(users: Sequence[Group]) -> Iterator[tuple]:
    for group in users:
        for zone in (INSIDE, BORDER):
            for low, high in COARSE:
                pixels = by_pose.pixel_sums(group, zone, low, high)[:, 0]
                poses = len(set(group.poses[pixels > 0.0].tolist()))
                where = ZONES[zone].rpartition(" ")[2]
                cells = _pixel_cells(group, zone, low, high)
                yield (group.label, where, f"{low:g}–{high:g}", poses, *cells)


def _matcher_rows(matchers: Sequence[Group]) -> Iterator[tuple]:
    for group in matchers:
        stixels = by_pose.stixel_sums(group, EDGES[0], EDGES[-1])
        yield (
            group.label,
            *_pixel_cells(group, INSIDE, EDGES[0], EDGES[-1]),
            cell(locking_swing(group, INSIDE)),
            *by_pose.cells(group, stixels, _OF_STIXELS),
            *by_pose.cells(group, by_pose.cover_sums(group), _OF_COVER),
        )
