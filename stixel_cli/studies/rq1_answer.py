"""The answer to RQ1 in a few sentences, all of whose numbers are computed."""

import math
from collections.abc import Iterator, Sequence

from stixel_cli.evaluation.stage_summary import (
    column_summary,
    coverage_summary,
    disparity_summary,
    stixel_summary,
)
from stixel_cli.studies.nouns import StudyData
from stixel_cli.studies.rq1_pool import (
    EDGES,
    ROUND,
    SW_DEPTH,
    SW_DEVIATION,
    Group,
    achieved,
    contrast,
    groups,
    locking_swing,
    matcher,
    needed_disparity,
    pool,
    rig,
    share,
    text,
)


def answer(data: StudyData, users: Sequence[Group]) -> Iterator[str]:
    """Sentences, the verdict first."""
    every = pool("all", [point for group in users for point in group.points])
    yield _verdict(every)
    yield from _rigs(data)
    yield _stages(every)
    yield from _matchers(data)
    yield _consistency(every)
    yield from _contrast(data)


def _verdict(every: Group) -> str:
    found = achieved(every)
    needed = needed_disparity(every.rig, SW_DEVIATION, SW_DEPTH)
    ratio = found["rms"] / SW_DEVIATION
    if not math.isfinite(ratio):
        return (
            f"No stixel lies on a road user between {ROUND[0]:g} and {ROUND[1]:g} m here, so the "
            f"{SW_DEVIATION:g} m at {SW_DEPTH:g} m of The Stixel World cannot be held against it."
        )
    beginning = "Like them in depth" if ratio <= 1.0 else "Alike in kind, not in depth"
    return (
        f"{beginning}: between {ROUND[0]:g} and {ROUND[1]:g} m the stixels of the default rig "
        f"on all road users are off by {text(found['rms'], 2, 'm')} RMS (bias "
        f"{text(found['bias'], 2, 'm')}), {text(ratio, 1)} times the {SW_DEVIATION:g} m at "
        f"{SW_DEPTH:g} m that Badino, Franke and Pfeiffer (2009, The Stixel World) state for their "
        f"own rig. It is {text(found['rms_px'], 3, 'px')} of disparity; {SW_DEVIATION:g} m would "
        f"take {text(needed, 3, 'px')} with this rig."
    )


def _rigs(data: StudyData) -> Iterator[str]:
    told = []
    for group in groups(data.parts["rigs"], rig):
        found = achieved(group)
        needed = needed_disparity(group.rig, SW_DEVIATION, SW_DEPTH)
        if math.isfinite(found["rms"]):
            told.append(
                f"{group.label} {text(found['rms'], 2, 'm')} ({text(found['rms_px'], 3, 'px')}, "
                f"needed {text(needed, 3, 'px')})"
            )
    if told:
        yield "The depth is first of all the rig's, RMS at that range: " + "; ".join(told) + "."


def _stages(every: Group) -> str:
    inside = disparity_summary(every.errors.disparity, every.seen, 0)
    of_target = every.errors.columns.of_target & every.seen[:, None]
    columns = every.errors.columns
    of = {
        name: column_summary(columns.true[of_target], getattr(columns, name)[of_target], every.rig)
        for name in ("grid", "path")
    }
    cover = coverage_summary(every.errors.stixels, every.seen)
    return (
        f"Over {EDGES[0]:g} to {EDGES[-1]:g} m, disparities inside the target have a bias of "
        f"{text(inside['bias'], 3, 'px')} and an RMS of {text(inside['rms'], 3, 'px')}, with "
        f"{share(inside['gross'])} gross and a density of {share(inside['density'])}. The grid "
        f"alone misses {share(of['grid']['missed'])} of the target's columns, the path through it "
        f"{share(of['path']['missed'])}; {share(cover['missed'])} are in no stixel, and "
        f"{text(cover['overhang'], 1)} columns a frame beside the target get its disparity."
    )


def _matchers(data: StudyData) -> Iterator[str]:
    told = []
    for group in groups(data.parts["matchers"], matcher):
        pixels = disparity_summary(group.errors.disparity, group.seen, 0)
        swing = locking_swing(group, 0)
        found = stixel_summary(group.errors.stixels, EDGES[0], EDGES[-1])
        told.append(
            f"{group.label} {text(pixels['rms'], 3, 'px')} RMS, locking to whole pixels "
            f"{text(swing, 3, 'px')} from peak to peak, stixels {text(found['rms_px'], 3, 'px')}"
        )
    if told:
        yield "Matchers, inside the target: " + "; ".join(told) + "."


def _consistency(every: Group) -> str:
    found = stixel_summary(every.errors.stixels, EDGES[0], EDGES[-1])
    nees = found["nees"]
    verdict = "–"
    if math.isfinite(nees):
        verdict = "too small" if nees > 1.0 else "on the safe side"
    return (
        f"The stated σ of the depth is {verdict}: the mean square of error over σ is "
        f"{text(nees)} (1 is consistent), {share(found['within_1'], 0)} of the stixels lie within "
        f"1 σ and {share(found['within_2'], 0)} within 2 σ (68 % and 95 % of a normal)."
    )


def _contrast(data: StudyData) -> Iterator[str]:
    found = groups(data.parts["contrast"], lambda point: f"{contrast(point):g}")
    found = sorted(found, key=lambda group: float(group.label))
    if len(found) < 2:
        return
    told = []
    for group in (found[0], found[-1]):
        pixels = disparity_summary(group.errors.disparity, group.seen, 0)
        cover = coverage_summary(group.errors.stixels, group.seen)
        told.append(
            f"contrast {group.label} leaves {share(pixels['density'])} of the pixels a disparity, "
            f"{text(pixels['rms'], 3, 'px')} RMS, and {share(cover['missed'])} of the columns "
            "without a stixel"
        )
    yield "Paint of " + "; of ".join(told) + "."
