"""RQ1's chapters on height, on stixels, and on what three rigs make of them."""

from collections.abc import Iterator, Sequence

from stixel_cli.evaluation.stage_summary import coverage_summary, stixel_summary
from stixel_cli.studies.nouns import Paragraph, Section, StudyData, Table
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import estimate
from stixel_cli.studies.rq1.pool import (
    COARSE,
    LEAST,
    ROUND,
    SW_DEPTH,
    SW_DEVIATION,
    Group,
    achieved,
    cell,
    groups,
    needed_disparity,
    rig,
)


def _stixel_value(name: str, spread: str | None = None) -> figures.Values:
    def value(group: Group, low: float, high: float):
        found = stixel_summary(group.errors.stixels, low, high)
        enough = found["stixels"] >= LEAST
        middle = found[name] if enough else float("nan")
        return middle if spread is None else (middle, found[spread] if enough else float("nan"))

    return value


def height_section(users: Sequence[Group]) -> Section:
    """Top and base rows of the stixels on the target, and their height."""
    panels = [
        ("Top row, bias (down is positive)", "px", {"": _stixel_value("top_bias")}),
        ("Top row, RMS", "px", {"": _stixel_value("top_rms")}),
        ("Height, bias", "m", {"": _stixel_value("height_bias")}),
        ("Base row, RMS", "px", {"": _stixel_value("base_rms")}),
    ]
    names = ("top_bias", "top_rms", "base_bias", "base_rms", "height_bias", "height_rms")
    return Section(
        "Height",
        (
            figures.over_range(
                "height",
                "Rows and height of the stixels on the target against the target's topmost row in "
                "their columns, and the row where its nearest surface stands; default rig.",
                users,
                panels,
            ),
            Table(
                "height",
                "Errors of the stixels on the target whose depth is not off by a gross error.",
                (
                    "road user",
                    "range m",
                    "stixels",
                    "top bias px",
                    "top RMS px",
                    "base bias px",
                    "base RMS px",
                    "height bias m",
                    "height RMS m",
                ),
                tuple(_stixel_rows(users, names)),
            ),
        ),
    )


def _stixel_rows(lines: Sequence[Group], names: Sequence[str], percent=()) -> Iterator[tuple]:
    for group in lines:
        for low, high in COARSE:
            found = stixel_summary(group.errors.stixels, low, high)
            cells = (cell(found[n], 100.0 if n in percent else 1.0) for n in names)
            yield (group.label, f"{low:g}–{high:g}", int(found["stixels"]), *cells)


def stixels_section(users: Sequence[Group]) -> Section:
    """Depth over range, normalised by σ, lateral, and how the target is covered."""
    cover = [
        (title, unit, {"": _cover_value(name)})
        for title, unit, name in (
            ("Stixels on the target", "a frame", "stixels"),
            ("Columns in no stixel", "share", "missed"),
            ("Columns in a stixel elsewhere", "share", "elsewhere"),
            ("Columns beside it that get its disparity", "a frame", "overhang"),
        )
    ]
    names = ("gross", "bias", "rms", "area_bias", "area_rms", "sigma", "nees", "within_1")
    names += ("lateral_rms",)
    return Section(
        "Stixels",
        (
            figures.over_range(
                "depth",
                "Depth error of the stixels on the target over range: mean, and as a band the "
                "standard deviation of single stixels round it (no interval of the mean); error in "
                "disparity; normalised square of the depth error; lateral error; default rig.",
                users,
                [
                    ("Depth error", "m", {"": _stixel_value("bias", "spread")}),
                    ("RMS in disparity", "px", {"": _stixel_value("rms_px")}),
                    ("Mean square of error / σ (1: consistent)", "", {"": _stixel_value("nees")}),
                    ("Lateral RMS", "m", {"": _stixel_value("lateral_rms")}),
                ],
            ),
            figures.normalised(
                "normalised",
                "Depth error over the stixel's own stated σ, all ranges, beside the standard "
                "normal; what is beyond ± 4 is in the outermost bins.",
                users,
            ),
            Table(
                "stixels",
                "Stixels on the target, default rig. The error is against the nearest surface in "
                "the stixel's columns; “area” is against the median depth of the target's pixels "
                "in the stixel.",
                (
                    "road user",
                    "range m",
                    "stixels",
                    "gross %",
                    "bias m",
                    "RMS m",
                    "area bias m",
                    "area RMS m",
                    "stated σ m",
                    "error²/σ²",
                    "within σ %",
                    "lateral RMS m",
                ),
                tuple(_stixel_rows(users, names, percent=("gross", "within_1"))),
            ),
            figures.over_range(
                "coverage", "How the target is covered by stixels; default rig.", users, cover
            ),
        ),
    )


def _cover_value(name: str) -> figures.Values:
    return lambda group, low, high: coverage_summary(group.errors.stixels, group.frames(low, high))[
        name
    ]


def rigs_section(data: StudyData) -> Section:
    """Depth error over range of three rigs, and the precision that 0.1 m at 28 m takes."""
    lines = groups(data.parts["rigs"], rig)
    return Section(
        "Three rigs, and the 0.1 m at 28 m of The Stixel World",
        (
            Paragraph(
                "A depth's deviation is z² σ_d / (f B): what a disparity's deviation means depends "
                f"on the rig. Badino, Franke and Pfeiffer (2009, The Stixel World) state less than "
                f"{SW_DEVIATION:g} m at {SW_DEPTH:g} m for theirs. With the rigs here that takes "
                "σ_d = f B σ_z / z², which the table holds against what the stixels achieve."
            ),
            figures.precision(
                "rigs",
                "RMS depth error of the stixels on all road users over range. The dashed line is "
                "what one and the same disparity error gives.",
                lines,
                SW_DEPTH,
                SW_DEVIATION,
                _stixel_value("rms"),
            ),
            Table(
                "rigs",
                f"Stixels at {ROUND[0]:g}–{ROUND[1]:g} m against the {SW_DEVIATION:g} m at "
                f"{SW_DEPTH:g} m of The Stixel World. “Area” is against the median depth of the "
                "target's pixels in the stixel, without what the surface's shape adds. Brackets: "
                "95 % intervals over the poses.",
                (
                    "rig",
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
        needed = needed_disparity(group.rig, SW_DEVIATION, SW_DEPTH)
        yield (
            group.label,
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
