"""RQ1's chapters on height, on stixels, and on what three rigs make of them."""

from collections.abc import Iterator, Sequence

from stixel_cli.results.text import listed
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import estimate
from stixel_cli.studies.rq1.pool import (
    COARSE,
    EDGES,
    ROUND,
    SW_DEPTH,
    SW_STD,
    Group,
    achieved,
    cell,
    counts,
    groups,
    needed_disparity,
    rig,
    seeds,
)
from stixel_cli.studies.tables import with_ends
from stixel_cli.studies.types import Paragraph, Section, StudyData, Table
from stixel_cli.validation.stage_errors import GROSS
from stixel_cli.validation.stage_summary import stixel_summary

_OF_HEIGHT = {
    "top bias px": by_pose.TOP_BIAS,
    "top RMS px": by_pose.TOP_RMS,
    "base bias px": by_pose.BASE_BIAS,
    "base RMS px": by_pose.BASE_RMS,
    "height bias m": by_pose.HEIGHT_BIAS,
    "height RMS m": by_pose.HEIGHT_RMS,
}
_OF_GROSS = {"gross %": by_pose.STIXEL_GROSS}
_OF_STIXELS = {
    "bias m": by_pose.STIXEL_BIAS,
    "RMS m": by_pose.STIXEL_RMS,
    "area bias m": by_pose.AREA_BIAS,
    "area RMS m": by_pose.AREA_RMS,
    "error²/σ²": by_pose.NEES,
    "within σ %": by_pose.WITHIN_1,
    "lateral RMS m": by_pose.LATERAL_RMS,
}


def _stixel_value(of: by_pose.Statistic) -> figures.Values:
    return by_pose.over_range(by_pose.stixel_sums, of)


def height_section(users: Sequence[Group]) -> Section:
    """Top and base rows of the stixels on the target, and their height."""
    panels = [
        ("Top row, bias (down is positive)", "px", {"": _stixel_value(by_pose.TOP_BIAS)}),
        ("Top row, RMS", "px", {"": _stixel_value(by_pose.TOP_RMS)}),
        ("Height, bias", "m", {"": _stixel_value(by_pose.HEIGHT_BIAS)}),
        ("Base row, RMS", "px", {"": _stixel_value(by_pose.BASE_RMS)}),
    ]
    return Section(
        "Height",
        (
            figures.over_range(
                "height",
                "Rows and height of the stixels on the target against the target's topmost row in "
                "their columns, and the base row of its nearest surface; default rig. Bands: "
                f"95 % intervals; {counts(users)}.",
                users,
                panels,
            ),
            Table(
                "height",
                "Rows and height of the stixels on the target, default rig. The errors are of "
                "those whose disparity is not off by a gross error (see the stixels' own table "
                f"for how many are); brackets: 95 % intervals over the poses; {seeds(users)}.",
                ("road user", "range m", "poses", "stixels", *with_ends(_OF_HEIGHT)),
                tuple(_height_rows(users)),
            ),
        ),
    )


def _height_rows(users: Sequence[Group]) -> Iterator[tuple]:
    for group, low, high, begin in _by_range(users):
        yield (*begin, *by_pose.cells(group, by_pose.stixel_sums(group, low, high), _OF_HEIGHT))


def _stixel_rows(users: Sequence[Group]) -> Iterator[tuple]:
    for group, low, high, begin in _by_range(users):
        sums = by_pose.stixel_sums(group, low, high)
        yield (
            *begin,
            *by_pose.cells(group, by_pose.gross_sums(group, low, high), _OF_GROSS),
            *by_pose.cells(group, sums, _OF_STIXELS),
            cell(stixel_summary(group.errors.stixels, low, high)["sigma"]),
        )


def _by_range(users: Sequence[Group]) -> Iterator[tuple[Group, float, float, tuple]]:
    """Each road user and range, with the beginning of its row: those, poses, stixels."""
    for group in users:
        for low, high in COARSE:
            count = by_pose.gross_sums(group, low, high)[:, 0]
            poses = len(set(group.poses[count > 0.0].tolist()))
            yield group, low, high, (group.label, f"{low:g}–{high:g}", poses, int(count.sum()))


def stixels_section(users: Sequence[Group]) -> Section:
    """Depth over range, normalised by σ, lateral, and how the target is covered."""
    cover = [
        (title, unit, {"": by_pose.over_range(by_pose.cover_sums, of, 1)})
        for title, unit, of in (
            ("Stixels on the target", "a frame", by_pose.STIXELS_A_FRAME),
            ("Columns in no stixel", "share", by_pose.UNCOVERED),
            ("Columns in a stixel elsewhere", "share", by_pose.ELSEWHERE),
            ("Columns beside it that get its disparity", "a frame", by_pose.OVERHANG),
        )
    ]
    return Section(
        "Stixels",
        (
            figures.over_range(
                "depth",
                "Stixels on the target over range: mean depth error (farther than the nearest "
                "surface where positive), RMS error in disparity, mean square of the depth error "
                "over its stated σ, RMS lateral error; default rig, gross errors left out. Bands: "
                f"95 % intervals; {counts(users)}.",
                users,
                [
                    ("Depth error, mean", "m", {"": _stixel_value(by_pose.STIXEL_BIAS)}),
                    ("RMS in disparity", "px", {"": _stixel_value(by_pose.STIXEL_RMS_PX)}),
                    (
                        "Mean square of error / σ (1: consistent)",
                        "",
                        {"": _stixel_value(by_pose.NEES)},
                    ),
                    ("Lateral RMS", "m", {"": _stixel_value(by_pose.LATERAL_RMS)}),
                ],
            ),
            figures.normalised(
                "normalised",
                "Depth error over the stixel's own stated σ, all ranges, beside the standard "
                f"normal; what is beyond ± 4 is in the outermost bins; {_stixel_counts(users)}.",
                users,
            ),
            Table(
                "stixels",
                "Stixels on the target, default rig. The error is against the nearest surface in "
                "the stixel's columns; “area” is against the median depth of the target's pixels "
                "in the stixel. Gross errors are counted among the stixels and left out of the "
                "other columns; brackets: 95 % intervals over the poses; "
                f"{seeds(users)}.",
                (
                    "road user",
                    "range m",
                    "poses",
                    "stixels",
                    *with_ends((*_OF_GROSS, *_OF_STIXELS)),
                    "stated σ m",
                ),
                tuple(_stixel_rows(users)),
            ),
            figures.over_range(
                "coverage",
                "How the target is covered by stixels; default rig. “Elsewhere” is more than "
                f"{GROSS:g} px off. Bands: 95 % intervals; {counts(users)}.",
                users,
                cover,
            ),
        ),
    )


def _stixel_counts(users: Sequence[Group]) -> str:
    found = [
        f"{group.label} {int(by_pose.stixel_sums(group, EDGES[0], EDGES[-1])[:, 0].sum())}"
        for group in users
    ]
    return f"stixels of all seeds: {listed(found)}"


def rigs_section(data: StudyData) -> Section:
    """Depth error over range of three rigs, and the precision that 0.1 m at 28 m takes."""
    lines = groups(data.sweeps["rigs"], rig)
    return Section(
        "Three rigs, and the 0.1 m at 28 m of The Stixel World",
        (
            Paragraph(
                "A depth's std is z² σ_d / (f B): what σ_d of a disparity means depends "
                f"on the rig. Badino, Franke and Pfeiffer (2009, The Stixel World) state less than "
                f"{SW_STD:g} m at {SW_DEPTH:g} m for theirs. With the rigs here that takes "
                "σ_d = f B σ_z / z², which the table compares with the stixels' errors."
            ),
            figures.precision(
                "rigs",
                "RMS depth error of the stixels on all road users over range, gross errors left "
                "out. The dashed line is what one and the same disparity error gives. Bands: 95 % "
                f"intervals; {counts(lines)}.",
                lines,
                SW_DEPTH,
                SW_STD,
                _stixel_value(by_pose.STIXEL_RMS),
            ),
            Table(
                "rigs",
                f"Stixels at {ROUND[0]:g}–{ROUND[1]:g} m against the {SW_STD:g} m at "
                f"{SW_DEPTH:g} m of The Stixel World; gross errors left out. “Area” is against the "
                "median depth of the target's pixels in the stixel, which on a stepped shape lie "
                "behind its nearest surface. Brackets: 95 % intervals over the poses.",
                (
                    "rig",
                    "image px",
                    "f px",
                    "B m",
                    "disparity there px",
                    "needed px",
                    "achieved RMS px",
                    "low RMS px",
                    "high RMS px",
                    "achieved / needed",
                    "depth bias m",
                    "low bias",
                    "high bias",
                    "depth RMS m",
                    "low RMS m",
                    "high RMS m",
                    "area RMS m",
                    "low area",
                    "high area",
                    "poses",
                    "stixels",
                ),
                tuple(_rig_rows(lines)),
            ),
        ),
    )


def _rig_rows(lines: Sequence[Group]) -> Iterator[tuple]:
    for group in lines:
        found = achieved(group)
        near = by_pose.stixel_sums(group, *ROUND)
        needed = needed_disparity(group.rig, SW_STD, SW_DEPTH)
        yield (
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
            *estimate(group, near, by_pose.AREA_RMS).cells,
            len(set(group.poses[near[:, 0] > 0.0].tolist())),
            int(found["stixels"]),
        )
