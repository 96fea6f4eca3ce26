"""RQ1: the numbers of the answer."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from stixel_cli.studies.forest import Row, forest
from stixel_cli.studies.rq1 import intervals as by_pose
from stixel_cli.studies.rq1.intervals import Estimate, difference, estimate
from stixel_cli.studies.rq1.pool import (
    COARSE,
    EDGES,
    INSIDE,
    LEAST,
    ROUND,
    SW_DEPTH,
    SW_STD,
    Group,
    needed_disparity,
)
from stixel_cli.studies.tables import with_ends
from stixel_cli.studies.types import Figure, Table
from stixel_cli.validation.stage_summary import stixel_summary


def answer_values(every: Group, users: Sequence[Group], lines: dict[str, list]) -> dict[str, Any]:
    """What the template's answer is filled with.

    Args:
        every: all road users of the default configuration together.
        users: a group for each of them.
        lines: groups by rig, matcher and grid, and of all road users by contrast.

    Returns:
        `leads`: label, RMS and bias round that depth of each road user; `forest`: plot of biases.
        `near`: the stixels round the depth that *The Stixel World* names, or None without any.
        `rig_lines`, `matcher_lines`, `grid_lines`, `contrast_lines`: values of each group.
        `bm_less_sgm`, `grid_differences`: differences at the same poses.
        `nees`: mean square of error over stated std, with its least and greatest range.
    """
    matchers = {group.label: group for group in lines["matchers"]}
    grids = lines["grids"]
    return {
        "leads": [(group.label, *_lead(group)) for group in users],
        "forest": _forest(users),
        "near": _near(every),
        "rig_lines": [line for group in lines["rigs"] if (line := _rig(group))],
        "matcher_lines": [
            (label, estimate(group, _stixels(group), by_pose.STIXEL_RMS_PX))
            for label, group in matchers.items()
        ],
        "bm_less_sgm": difference(matchers["BM"], matchers["SGM"], _stixels, by_pose.STIXEL_RMS_PX)
        if {"SGM", "BM"} <= set(matchers)
        else None,
        "grid_lines": [
            (
                group.label,
                estimate(group, _columns(group), by_pose.COLUMN_RMS),
                estimate(group, _columns(group), by_pose.COLUMN_MISSED),
            )
            for group in grids
        ],
        "grid_differences": [
            (group.label, difference(group, grids[0], _columns, by_pose.COLUMN_RMS))
            for group in grids[1:]
        ],
        "nees": _nees(every, users),
        "contrast_lines": [
            (
                group.label,
                estimate(group, by_pose.pixel_sums(group, INSIDE), by_pose.PIXEL_RMS),
                estimate(group, by_pose.pixel_sums(group, INSIDE), by_pose.PIXEL_DENSITY),
                estimate(group, by_pose.cover_sums(group), by_pose.UNCOVERED),
            )
            for group in lines["contrasts"]
        ],
        "poses": len(set(every.poses[every.seen].tolist())),
        "seeds": len({run.seed for run in every.runs}),
    }


def _lead(group: Group) -> tuple[Estimate, Estimate]:
    """RMS and bias of the depth round the depth that *The Stixel World* names, m."""
    sums = by_pose.stixel_sums(group, *ROUND)
    return (
        estimate(group, sums, by_pose.STIXEL_RMS),
        estimate(group, sums, by_pose.STIXEL_BIAS),
    )


def _forest(users: Sequence[Group]) -> Figure | None:
    """Bias of depth, disparity and height of each road user; no test covers them."""
    biases = (
        (f"bias of the depth, {ROUND[0]:g} to {ROUND[1]:g} m", "m", lambda group: _lead(group)[1]),
        (
            "bias of the disparity, all ranges",
            "px",
            lambda group: estimate(group, by_pose.pixel_sums(group, INSIDE), by_pose.pixel_bias),
        ),
        (
            "bias of the height, all ranges",
            "m",
            lambda group: estimate(group, _stixels(group), by_pose.HEIGHT_BIAS),
        ),
    )
    rows = [
        Row(group.label, "stixels", metric, unit, *one.cells)
        for metric, unit, of in biases
        for group in users
        for one in [of(group)]
    ]
    return forest("answer_forest", rows)


def _near(every: Group) -> dict[str, Any] | None:
    sums = by_pose.stixel_sums(every, *ROUND)
    rms = estimate(every, sums, by_pose.STIXEL_RMS)
    if not math.isfinite(rms.value):
        return None
    return {
        "verdict": "yes" if rms.high <= SW_STD else "no" if rms.low > SW_STD else "not clear",
        "rms": rms,
        "gross_share": stixel_summary(every.errors.stixels, *ROUND)["gross"],
        "bias": estimate(every, sums, by_pose.STIXEL_BIAS),
        "ratio": rms.scaled(1.0 / SW_STD),
        "rms_px": estimate(every, sums, by_pose.STIXEL_RMS_PX),
        "needed": needed_disparity(every.rig, SW_STD, SW_DEPTH),
        "own": {
            "square": estimate(every, sums, by_pose.SQUARE_RMS),
            "slanted or stepped": estimate(every, sums, by_pose.SLANTED_RMS),
        },
    }


def _rig(group: Group) -> tuple[str, Estimate, float] | None:
    """Label, RMS m and the disparity's std, px, that The Stixel World's std takes."""
    rms = estimate(group, by_pose.stixel_sums(group, *ROUND), by_pose.STIXEL_RMS)
    if not math.isfinite(rms.value):
        return None
    return group.label, rms, needed_disparity(group.rig, SW_STD, SW_DEPTH)


def _nees(every: Group, users: Sequence[Group]) -> dict[str, Any] | None:
    nees = estimate(every, _stixels(every), by_pose.NEES)
    if not math.isfinite(nees.value):
        return None
    by_range = [
        (found["nees"], f"{group.label}, {low:g}–{high:g} m")
        for group in users
        for low, high in COARSE
        if (found := stixel_summary(group.errors.stixels, low, high))["stixels"] >= LEAST
        and math.isfinite(found["nees"])
    ]
    return {
        "all": nees,
        "verdict": "too small"
        if nees.low > 1.0
        else "too large"
        if nees.high < 1.0
        else "not shown to be wrong",
        "ends": (min(by_range), max(by_range)) if len(by_range) > 1 else None,
    }


def _stixels(group: Group) -> np.ndarray:
    return by_pose.stixel_sums(group, EDGES[0], EDGES[-1])


def _columns(group: Group) -> np.ndarray:
    return by_pose.column_sums(group, "path")


def answer_table(every: Group) -> Table:
    """Errors of each stage of the default configuration, over all road users and ranges."""
    return Table(
        "answer",
        "",
        ("stage", "measure", "unit", *with_ends(["value"])),
        tuple(
            (stage, measure, unit, *(found.scaled(100.0) if unit == "%" else found).cells)
            for stage, measure, unit, found in _stages(every)
        ),
    )


def _stages(every: Group) -> Iterator[tuple[str, str, str, Estimate]]:
    """Stage, measure, unit and estimate."""
    pixels = by_pose.pixel_sums(every, INSIDE)
    yield "disparity", "bias", "px", estimate(every, pixels, by_pose.pixel_bias)
    yield "disparity", "RMS", "px", estimate(every, pixels, by_pose.PIXEL_RMS)
    yield "disparity", "gross errors", "%", estimate(every, pixels, by_pose.PIXEL_GROSS)
    yield (
        "disparity",
        "pixels with a disparity",
        "%",
        estimate(every, pixels, by_pose.PIXEL_DENSITY),
    )
    for stage, step in (("occupancy grid, without the path", "grid"), ("free space", "path")):
        columns = by_pose.column_sums(every, step)
        missed = estimate(every, columns, by_pose.COLUMN_MISSED)
        yield stage, "target's columns missed", "%", missed
    cover = by_pose.cover_sums(every)
    uncovered = estimate(every, cover, by_pose.UNCOVERED)
    yield "stixels", "target's columns without a stixel", "%", uncovered
    unseen = estimate(every, cover, by_pose.UNSEEN)
    yield "stixels", "target's width that no stixel covers", "%", unseen
    overhang = estimate(every, cover, by_pose.OVERHANG)
    yield "stixels", "columns next to the target, per frame", "", overhang
    gross = by_pose.gross_sums(every, EDGES[0], EDGES[-1])
    yield "stixels", "gross errors", "%", estimate(every, gross, by_pose.STIXEL_GROSS)
    stixels = _stixels(every)
    yield "stixels", "disparity, RMS", "px", estimate(every, stixels, by_pose.STIXEL_RMS_PX)
    for truth, bias, rms in (
        ("front face", by_pose.STIXEL_BIAS, by_pose.STIXEL_RMS),
        ("own pixels, square", by_pose.SQUARE_BIAS, by_pose.SQUARE_RMS),
        ("own pixels, slanted", by_pose.SLANTED_BIAS, by_pose.SLANTED_RMS),
    ):
        yield "stixels", f"depth, {truth}, bias", "m", estimate(every, stixels, bias)
        yield "stixels", f"depth, {truth}, RMS", "m", estimate(every, stixels, rms)
    yield "stixels", "height, bias", "m", estimate(every, stixels, by_pose.HEIGHT_BIAS)
    yield "stixels", "height, RMS", "m", estimate(every, stixels, by_pose.HEIGHT_RMS)
    yield "stated σ", "mean square of error / σ", "", estimate(every, stixels, by_pose.NEES)
    yield "stated σ", "stixels within 1 σ", "%", estimate(every, stixels, by_pose.WITHIN_1)
    yield "stated σ", "stixels within 2 σ", "%", estimate(every, stixels, by_pose.WITHIN_2)
