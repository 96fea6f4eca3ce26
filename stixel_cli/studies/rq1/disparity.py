"""RQ1's chapter on disparity: over range, by matcher, and the locking to whole pixels."""

from collections.abc import Iterator, Sequence

from stixel_cli.evaluation.stage_errors import ZONES
from stixel_cli.evaluation.stage_summary import coverage_summary, disparity_summary
from stixel_cli.studies.nouns import Section, StudyData, Table
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import estimate
from stixel_cli.studies.rq1.pool import (
    COARSE,
    EDGES,
    Group,
    cell,
    counts,
    groups,
    locking_swing,
    matcher,
)

INSIDE, BORDER = 0, 1


def disparity_section(data: StudyData, users: Sequence[Group]) -> Section:
    """Bias, RMS, gross share and density over range, pixel locking, SGM against BM."""
    matchers = groups(data.parts["matchers"], matcher)

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
    columns = ("pixels", "density %", "gross %", "bias px", "RMS px", "median px")
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
                f"in every seed: {counts(users)}.",
                ("road user", "zone", "range m", *columns),
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
                        "frames, gross errors left out; brackets: 95 % intervals over the poses; "
                        f"{counts(matchers)}.",
                        (
                            "matcher",
                            *columns,
                            "locking px",
                            "stixel RMS px",
                            "low px",
                            "high px",
                            "stixel RMS m",
                            "low m",
                            "high m",
                            "columns in no stixel %",
                        ),
                        tuple(_matcher_rows(matchers)),
                    ),
                ),
            ),
        ),
    )


def _pixel_cells(found: dict[str, float]) -> tuple:
    percent = (cell(found[name], 100.0) for name in ("density", "gross"))
    return (
        int(found["pixels"]),
        *percent,
        *(cell(found[name]) for name in ("bias", "rms", "median")),
    )


def _disparity_rows(users: Sequence[Group]) -> Iterator[tuple]:
    for group in users:
        for zone in (INSIDE, BORDER):
            for low, high in COARSE:
                chosen = group.frames(low, high)
                found = disparity_summary(group.errors.disparity, chosen, zone)
                where = ZONES[zone].rpartition(" ")[2]
                yield (group.label, where, f"{low:g}–{high:g}", *_pixel_cells(found))


def _matcher_rows(matchers: Sequence[Group]) -> Iterator[tuple]:
    for group in matchers:
        found = disparity_summary(group.errors.disparity, group.seen, INSIDE)
        stixels = by_pose.stixel_sums(group, EDGES[0], EDGES[-1])
        cover = coverage_summary(group.errors.stixels, group.seen)
        yield (
            group.label,
            *_pixel_cells(found),
            cell(locking_swing(group, INSIDE)),
            *estimate(group, stixels, by_pose.STIXEL_RMS_PX).cells,
            *estimate(group, stixels, by_pose.STIXEL_RMS).cells,
            cell(cover["missed"], 100.0),
        )
