"""The answer to RQ1 in a few sentences, all of whose numbers are computed."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from stixel_cli.results.text import listed
from stixel_cli.studies.prose import counted, number, quantity
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import Estimate, estimate
from stixel_cli.studies.rq1.pool import (
    COARSE,
    EDGES,
    LEAST,
    ROUND,
    SW_DEPTH,
    SW_STD,
    Group,
    contrast,
    grid,
    groups,
    matcher,
    needed_disparity,
    rig,
    seeds,
    share,
    text,
)
from stixel_cli.studies.rq1.setup import cpu_seconds_a_frame, lines_of, values_of
from stixel_cli.studies.types import StudyData, Table
from stixel_cli.validation.stage_errors import GROSS
from stixel_cli.validation.stage_summary import stixel_summary

_INSIDE = 0


def answer(data: StudyData, users: Sequence[Group], every: Group) -> Iterator[str]:
    """Sentences, the verdict first; `every` is all road users together."""
    yield _verdict(every)
    yield from _rigs(data)
    yield from _matchers(data)
    yield from _grids(data)
    yield _consistency(every, users)
    yield from _contrast(data)
    yield _setup(data)
    yield _limits(every)


def answer_table(every: Group) -> Table:
    """What each stage of the default configuration is off by, over all road users and ranges."""
    return Table(
        "answer",
        f"Stage by stage, default configuration, {EDGES[0]:g} to {EDGES[-1]:g} m, with 95 % "
        "intervals. Gross errors are counted apart and left out of every bias, RMS and σ.",
        ("stage", "measure", "unit", "value", "low value", "high value"),
        tuple(
            (stage, measure, unit, *(found.scaled(100.0) if unit == "%" else found).cells)
            for stage, measure, unit, found in _stages(every)
        ),
    )


def _verdict(every: Group) -> str:
    near = by_pose.stixel_sums(every, *ROUND)
    rms = estimate(every, near, by_pose.STIXEL_RMS)
    if not math.isfinite(rms.value):
        return (
            f"No stixel is on a road user between {ROUND[0]:g} and {ROUND[1]:g} m here, so the "
            f"{SW_STD:g} m at {SW_DEPTH:g} m of The Stixel World cannot be compared."
        )
    beginning = (
        "In depth, yes"
        if rms.high <= SW_STD
        else "In depth, no"
        if rms.low > SW_STD
        else "In depth, not clear"
    )
    gross = stixel_summary(every.errors.stixels, *ROUND)["gross"]
    left_out = f" ({share(gross)} of them, off by more than {GROSS:g} px, left out)" * (gross > 0.0)
    needed = needed_disparity(every.rig, SW_STD, SW_DEPTH)
    return (
        f"{beginning}: between {ROUND[0]:g} and {ROUND[1]:g} m the stixels of the default rig on "
        f"all road users are off by {rms.text('m')} RMS{left_out}, with a bias of "
        f"{estimate(every, near, by_pose.STIXEL_BIAS).text('m', sign=True)} (farther than the "
        f"nearest surface where positive); that is {rms.scaled(1.0 / SW_STD).text()} times "
        f"the {SW_STD:g} m at {SW_DEPTH:g} m below which Badino, Franke and Pfeiffer (2009, "
        "The Stixel World) state their uncertainty, for their own rig. In disparity it is "
        f"{estimate(every, near, by_pose.STIXEL_RMS_PX).text('px')}; {SW_STD:g} m would take "
        f"{text(needed, 3, 'px')} with this rig. Against the median depth of the target inside the "
        "stixel's own area, in place of its nearest surface, it is "
        f"{estimate(every, near, by_pose.AREA_RMS).text('m')} RMS."
    )


def _rigs(data: StudyData) -> Iterator[str]:
    told = []
    lines = groups(data.sweeps["rigs"], rig)
    for group in lines:
        rms = estimate(group, by_pose.stixel_sums(group, *ROUND), by_pose.STIXEL_RMS)
        needed = needed_disparity(group.rig, SW_STD, SW_DEPTH)
        if math.isfinite(rms.value):
            told.append(
                f"{rms.text('m')} with the {group.label} rig, where {SW_STD:g} m takes "
                f"{text(needed, 3, 'px')}"
            )
    if told:
        yield (
            "The depth error depends on the rig. RMS at that range, "
            f"{seeds(lines)}: {'; '.join(told)}."
        )


def _stages(every: Group) -> Iterator[tuple[str, str, str, Estimate]]:
    """Stage, measure, unit and estimate."""
    pixels = by_pose.pixel_sums(every, _INSIDE)
    yield "disparity", "bias", "px", estimate(every, pixels, by_pose.pixel_bias)
    yield "disparity", "RMS", "px", estimate(every, pixels, by_pose.PIXEL_RMS)
    yield "disparity", "gross errors", "%", estimate(every, pixels, by_pose.PIXEL_GROSS)
    yield "disparity", "pixels that have one", "%", estimate(every, pixels, by_pose.PIXEL_DENSITY)
    for stage, step in (("occupancy grid, by itself", "grid"), ("free space", "path")):
        columns = by_pose.column_sums(every, step)
        missed = estimate(every, columns, by_pose.COLUMN_MISSED)
        yield stage, "target's columns missed", "%", missed
    cover = by_pose.cover_sums(every)
    uncovered = estimate(every, cover, by_pose.UNCOVERED)
    yield "stixels", "target's columns in none", "%", uncovered
    overhang = estimate(every, cover, by_pose.OVERHANG)
    yield "stixels", "columns beside the target, a frame", "", overhang
    gross = by_pose.gross_sums(every, EDGES[0], EDGES[-1])
    yield "stixels", "gross errors", "%", estimate(every, gross, by_pose.STIXEL_GROSS)
    stixels = _stixels(every)
    yield "stixels", "disparity, RMS", "px", estimate(every, stixels, by_pose.STIXEL_RMS_PX)
    yield "stixels", "depth, bias", "m", estimate(every, stixels, by_pose.STIXEL_BIAS)
    yield "stixels", "depth, RMS", "m", estimate(every, stixels, by_pose.STIXEL_RMS)
    yield "stixels", "height, bias", "m", estimate(every, stixels, by_pose.HEIGHT_BIAS)
    yield "stixels", "height, RMS", "m", estimate(every, stixels, by_pose.HEIGHT_RMS)
    yield "stated σ", "mean square of error / σ", "", estimate(every, stixels, by_pose.NEES)
    yield "stated σ", "stixels within 1 σ", "%", estimate(every, stixels, by_pose.WITHIN_1)
    yield "stated σ", "stixels within 2 σ", "%", estimate(every, stixels, by_pose.WITHIN_2)


def _matchers(data: StudyData) -> Iterator[str]:
    found = groups(data.sweeps["matchers"], matcher)
    if not found:
        return
    told = [
        f"{estimate(group, _stixels(group), by_pose.STIXEL_RMS_PX).text('px')} with {group.label}"
        for group in found
    ]
    sentence = (
        "Matchers (SGM: semi-global, Hirschmüller 2008; BM: block matching, Konolige 1997), "
        f"disparity of the stixels, RMS: {listed(told)}."
    )
    by_name = {group.label: group for group in found}
    if {"SGM", "BM"} <= set(by_name):
        apart = by_pose.difference(by_name["BM"], by_name["SGM"], _stixels, by_pose.STIXEL_RMS_PX)
        verdict = (
            "no difference is shown"
            if not math.isfinite(apart.low) or apart.low <= 0.0 <= apart.high
            else "BM is the better"
            if apart.high < 0.0
            else "SGM is the better"
        )
        sentence += f" BM minus SGM, at the same poses: {apart.text('px', sign=True)}, {verdict}."
    yield sentence


def _stixels(group: Group) -> np.ndarray:
    return by_pose.stixel_sums(group, EDGES[0], EDGES[-1])


def _grids(data: StudyData) -> Iterator[str]:
    found = groups(data.sweeps["grids"], grid)
    told, apart = [], []
    for group in found:
        sums = by_pose.column_sums(group, "path")
        rms, missed = (
            estimate(group, sums, of) for of in (by_pose.COLUMN_RMS, by_pose.COLUMN_MISSED)
        )
        told.append(f"{group.label} {rms.text('px')} RMS and {missed.share()} missed")
        if group is not found[0]:
            less = by_pose.difference(
                group,
                found[0],
                lambda one: by_pose.column_sums(one, "path"),
                by_pose.COLUMN_RMS,
            )
            apart.append(f"{group.label} {less.text('px', sign=True)}")
    if told:
        sentence = f"Grids, after the path, the target's columns: {'; '.join(told)}."
        if apart:
            sentence += f" RMS minus that of {found[0].label}, at the same poses: {listed(apart)}."
        yield sentence


def _consistency(every: Group, users: Sequence[Group]) -> str:
    nees = estimate(every, _stixels(every), by_pose.NEES)
    if not math.isfinite(nees.value):
        return "The stated σ cannot be assessed: no stixel is on a road user."
    verdict = (
        "too small"
        if nees.low > 1.0
        else "too large"
        if nees.high < 1.0
        else "not shown to be wrong"
    )
    by_range = [
        (found["nees"], f"{group.label}, {low:g}–{high:g} m")
        for group in users
        for low, high in COARSE
        if (found := stixel_summary(group.errors.stixels, low, high))["stixels"] >= LEAST
        and math.isfinite(found["nees"])
    ]
    spread = ""
    if len(by_range) > 1:
        (least, where_least), (most, where_most) = min(by_range), max(by_range)
        spread = (
            f", from {text(least)} ({where_least}) to {text(most)} ({where_most}), so it "
            "depends on the range"
        )
    return (
        f"Over all ranges together, the stated σ of the depth is {verdict}: the mean square of "
        f"error over σ is {nees.text()} (1 is consistent){spread}."
    )


def _contrast(data: StudyData) -> Iterator[str]:
    found = groups(data.sweeps["contrast"], lambda point: f"{contrast(point):g}")
    found = sorted(found, key=lambda group: float(group.label))
    if len(found) < 2:
        return
    told = []
    for group in (found[0], found[-1]):
        pixels = by_pose.pixel_sums(group, _INSIDE)
        in_none = estimate(group, by_pose.cover_sums(group), by_pose.UNCOVERED)
        told.append(
            f"at {group.label} an RMS of {estimate(group, pixels, by_pose.PIXEL_RMS).text('px')}, "
            f"{estimate(group, pixels, by_pose.PIXEL_DENSITY).share()} of the pixels with a "
            f"disparity, {in_none.share()} of the columns in no stixel"
        )
    yield f"Disparities inside the target by the contrast of its paint: {'; '.join(told)}."


def _setup(data: StudyData) -> str:
    points = data.sweeps["ranges"].runs
    lines = lines_of(data.name)
    cost = cpu_seconds_a_frame(points, "render")
    return (
        "To set up a scene takes "
        f"{values_of(points[0].configuration)} values, all of which have a default"
        + (f" (the whole of this study {lines} lines of YAML)" if lines else "")
        + (
            f", and {quantity(cost, 's')} of CPU time a frame to render"
            if math.isfinite(cost)
            else ""
        )
        + "."
    )


def _limits(every: Group) -> str:
    poses = len(set(every.poses[every.seen].tolist()))
    seeds = len({point.seed for point in every.runs})
    return (
        f"Brackets are 95 % intervals of a bootstrap over {number(poses)} poses (a road user at a "
        f"range), road user by road user; {counted(seeds, 'seed')} a pose share its rendering "
        "and count as one. Scenes are rendered, with one shape for each class, one street and "
        "one light, and every road user drives straight towards the camera. Errors that only real "
        "images have, and the rig of The Stixel World, are not included."
    )
