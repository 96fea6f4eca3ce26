"""The answer to RQ1 in a few sentences, all of whose numbers are computed."""

import math
from collections.abc import Iterator, Sequence

from stixel_cli.evaluation.stage_errors import GROSS
from stixel_cli.evaluation.stage_summary import stixel_summary
from stixel_cli.studies.nouns import StudyData
from stixel_cli.studies.prose import counted, listed, number, quantity
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import Estimate, estimate
from stixel_cli.studies.rq1.pool import (
    COARSE,
    EDGES,
    LEAST,
    ROUND,
    SW_DEPTH,
    SW_DEVIATION,
    Group,
    contrast,
    grid,
    groups,
    locking_swing,
    matcher,
    needed_disparity,
    pool,
    rig,
    share,
    text,
)
from stixel_cli.studies.rq1.setup import lines_of, seconds_a_frame, values_of

_INSIDE = 0


def answer(data: StudyData, users: Sequence[Group]) -> Iterator[str]:
    """Sentences, the verdict first."""
    every = pool("all", [point for group in users for point in group.points])
    yield _verdict(every)
    yield from _rigs(data)
    yield _stages(every)
    yield from _matchers(data)
    yield from _grids(data)
    yield _consistency(every, users)
    yield from _contrast(data)
    yield _setup(data)
    yield _limits(every)


def _verdict(every: Group) -> str:
    near = by_pose.stixel_sums(every, *ROUND)
    rms = estimate(every, near, by_pose.STIXEL_RMS)
    if not math.isfinite(rms.value):
        return (
            f"No stixel lies on a road user between {ROUND[0]:g} and {ROUND[1]:g} m here, so the "
            f"{SW_DEVIATION:g} m at {SW_DEPTH:g} m of The Stixel World cannot be held against it."
        )
    beginning = (
        "In depth, yes"
        if rms.high <= SW_DEVIATION
        else "In depth, no"
        if rms.low > SW_DEVIATION
        else "In depth it cannot be told"
    )
    gross = stixel_summary(every.errors.stixels, *ROUND)["gross"]
    needed = needed_disparity(every.rig, SW_DEVIATION, SW_DEPTH)
    return (
        f"{beginning}: between {ROUND[0]:g} and {ROUND[1]:g} m the stixels of the default rig on "
        f"all road users are off by {rms.text('m')} RMS ({share(gross)} of them, off by more than "
        f"{GROSS:g} px, left out), with a bias of "
        f"{estimate(every, near, by_pose.STIXEL_BIAS).text('m', sign=True)} (farther than the "
        f"nearest surface where positive); that is {rms.scaled(1.0 / SW_DEVIATION).text()} times "
        f"the {SW_DEVIATION:g} m at {SW_DEPTH:g} m below which Badino, Franke and Pfeiffer (2009, "
        "The Stixel World) state their uncertainty, for their own rig. In disparity it is "
        f"{estimate(every, near, by_pose.STIXEL_RMS_PX).text('px')}; {SW_DEVIATION:g} m would take "
        f"{text(needed, 3, 'px')} with this rig. Against the median depth of the target inside the "
        "stixel's own area, in place of its nearest surface, it is "
        f"{estimate(every, near, by_pose.AREA_RMS).text('m')} RMS."
    )


def _rigs(data: StudyData) -> Iterator[str]:
    told = []
    for group in groups(data.parts["rigs"], rig):
        near = by_pose.stixel_sums(group, *ROUND)
        rms = estimate(group, near, by_pose.STIXEL_RMS)
        needed = needed_disparity(group.rig, SW_DEVIATION, SW_DEPTH)
        if math.isfinite(rms.value):
            pixels = estimate(group, near, by_pose.STIXEL_RMS_PX)
            told.append(
                f"{rms.text('m')} with the {group.label} rig ({pixels.text('px')}, where "
                f"{SW_DEVIATION:g} m takes {text(needed, 3, 'px')})"
            )
    if told:
        yield f"How far the depth is off depends on the rig. RMS at that range: {listed(told)}."


def _stages(every: Group) -> str:
    pixels = by_pose.pixel_sums(every, _INSIDE)
    bias, rms, gross, density = (
        estimate(every, pixels, of)
        for of in (
            by_pose.pixel_bias,
            by_pose.PIXEL_RMS,
            by_pose.PIXEL_GROSS,
            by_pose.PIXEL_DENSITY,
        )
    )
    grid_missed, path_missed = (
        estimate(every, by_pose.column_sums(every, step), by_pose.COLUMN_MISSED)
        for step in ("grid", "path")
    )
    gross_stixels = stixel_summary(every.errors.stixels, EDGES[0], EDGES[-1])["gross"]
    cover = by_pose.cover_sums(every)
    in_none, beside = (estimate(every, cover, of) for of in (by_pose.UNCOVERED, by_pose.OVERHANG))
    stixels = by_pose.stixel_sums(every, EDGES[0], EDGES[-1])
    heights = [estimate(every, stixels, of) for of in (by_pose.HEIGHT_BIAS, by_pose.HEIGHT_RMS)]
    return (
        f"Stage by stage, over {EDGES[0]:g} to {EDGES[-1]:g} m: disparities inside the target have "
        f"a bias of {bias.text('px', sign=True)} and an RMS of {rms.text('px')}; {gross.share()} "
        f"are gross errors and {density.share()} of the pixels have one. The occupancy grid by "
        f"itself misses {grid_missed.share()} of the target's columns, free space's path through "
        f"it {path_missed.share()}; {in_none.share()} end up in no stixel, and {beside.text()} "
        "columns a frame beside the target are given its disparity. Of the stixels on it "
        f"{share(gross_stixels)} are gross errors, which are left out of what follows. "
        f"A stixel's height is off by {heights[1].text('m')} RMS, with a bias of "
        f"{heights[0].text('m', sign=True)}."
    )


def _matchers(data: StudyData) -> Iterator[str]:
    found = groups(data.parts["matchers"], matcher)
    told = []
    for group in found:
        pixels = estimate(group, by_pose.pixel_sums(group, _INSIDE), by_pose.PIXEL_RMS)
        stixels = estimate(
            group, by_pose.stixel_sums(group, EDGES[0], EDGES[-1]), by_pose.STIXEL_RMS_PX
        )
        told.append(
            f"{group.label}: pixels {pixels.text('px')} RMS, stixels {stixels.text('px')}, locking "
            f"to whole pixels {text(locking_swing(group, _INSIDE), 3, 'px')} from peak to peak"
        )
    if not told:
        return
    sentence = (
        "Matchers (SGM: semi-global, Hirschmüller 2008; BM: block matching, Konolige 1997), inside "
        f"the target. {'; '.join(told)}."
    )
    by_name = {group.label: group for group in found}
    if {"SGM", "BM"} <= set(by_name):
        apart = _matchers_apart(by_name["BM"], by_name["SGM"])
        verdict = (
            "no difference is shown"
            if not math.isfinite(apart.low) or apart.low <= 0.0 <= apart.high
            else "BM is the better"
            if apart.high < 0.0
            else "SGM is the better"
        )
        sentence += (
            f" Stixels of BM minus those of SGM, of the same poses: {apart.text('px', sign=True)} "
            f"RMS, {verdict}."
        )
    yield sentence


def _matchers_apart(one: Group, other: Group) -> Estimate:
    return by_pose.difference(
        one,
        other,
        lambda group: by_pose.stixel_sums(group, EDGES[0], EDGES[-1]),
        by_pose.STIXEL_RMS_PX,
    )


def _grids(data: StudyData) -> Iterator[str]:
    found = groups(data.parts["grids"], grid)
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
            sentence += f" RMS less that of {found[0].label}, of the same poses: {listed(apart)}."
        yield sentence


def _consistency(every: Group, users: Sequence[Group]) -> str:
    sums = by_pose.stixel_sums(every, EDGES[0], EDGES[-1])
    nees, within_1, within_2 = (
        estimate(every, sums, of) for of in (by_pose.NEES, by_pose.WITHIN_1, by_pose.WITHIN_2)
    )
    if not math.isfinite(nees.value):
        return "Of the stated σ nothing can be said: no stixel lies on a road user."
    verdict = (
        "too small"
        if nees.low > 1.0
        else "on the safe side"
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
            f", from {text(least)} ({where_least}) to {text(most)} ({where_most}), so not "
            "everywhere alike"
        )
    return (
        f"Over all ranges together, the stated σ of the depth is {verdict}: the mean square of "
        f"error over σ is {nees.text()} (1 is consistent){spread}; {within_1.share()} of the "
        f"stixels lie within 1 σ and {within_2.share()} within 2 σ, where a normal has 68 % and "
        "95 %."
    )


def _contrast(data: StudyData) -> Iterator[str]:
    found = groups(data.parts["contrast"], lambda point: f"{contrast(point):g}")
    found = sorted(found, key=lambda group: float(group.label))
    if len(found) < 2:
        return
    told = []
    for group in (found[0], found[-1]):
        pixels = by_pose.pixel_sums(group, _INSIDE)
        in_none = estimate(group, by_pose.cover_sums(group), by_pose.UNCOVERED)
        told.append(
            f"with contrast {group.label} {estimate(group, pixels, by_pose.PIXEL_RMS).text('px')} "
            f"RMS, {estimate(group, pixels, by_pose.PIXEL_DENSITY).share()} of the pixels with a "
            f"disparity, {in_none.share()} of the columns in no stixel"
        )
    yield f"The paint's contrast, disparities inside the target: {'; '.join(told)}."


def _setup(data: StudyData) -> str:
    points = data.parts["ranges"].points
    lines = lines_of(data.name)
    return (
        "To set up a scene takes "
        f"{values_of(points[0].configuration)} values, all of which have a default"
        + (f" (the whole of this study {lines} lines of YAML)" if lines else "")
        + f", and {quantity(seconds_a_frame(points, 'render'), 's')} a frame to render."
    )


def _limits(every: Group) -> str:
    poses = len(set(every.poses[every.seen].tolist()))
    seeds = len({point.seed for point in every.points})
    return (
        f"Brackets are 95 % intervals of a bootstrap over {number(poses)} poses (a road user at a "
        f"range), road user by road user; {counted(seeds, 'seed')} a pose share its rendering "
        "and are not counted as more. Scenes are rendered, with one shape a class, one street and "
        "one light, and everybody comes straight on: an error that only real images have is not "
        "in here, and neither is The Stixel World's own rig."
    )
