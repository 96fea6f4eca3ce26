"""RQ1: the numbers of the answer."""

from collections.abc import Mapping, Sequence
from typing import Any

from stixel_cli.report.blocks import Figure
from stixel_cli.report.forest import Row, forest
from stixel_cli.studies.rq1 import errors as of


def answer_values(
    every: of.Errors, users: Sequence[of.Errors], lines: Mapping[str, Sequence[of.Errors]]
) -> dict[str, Any]:
    """What the template's answer is filled with.

    Args:
        every: all road users of the default configuration together.
        users: each of them.
        lines: parts by rig, matcher and grid, and of all road users by contrast.

    Returns:
        `leads`: label, RMS and bias round that depth of each road user; `forest`: plot of biases.
        `near`: the stixels round the depth that *The Stixel World* names, or None without any.
        `rig_lines`, `matcher_lines`, `grid_lines`, `contrast_lines`: values of each setting.
        `bm_less_sgm`, `grid_differences`: differences at the same poses.
        `nees`: mean square of error over stated std, with its least and greatest range.
    """
    matchers = {own.label: own for own in lines["matchers"]}
    grids, both = lines["grids"], {"SGM", "BM"} <= set(matchers)
    columns, missed = of.of_columns("px", root=True), of.of_columns("missed")
    near = [(own, own.between(*of.ROUND).estimate(of.RMS)) for own in lines["rigs"]]
    return {
        "leads": [(own.label, *_lead(own)) for own in users],
        "forest": _forest(users),
        "near": _near(every.between(*of.ROUND)),
        "rig_lines": [
            (own.label, rms, of.needed_disparity(own.rig, of.SW_STD, of.SW_DEPTH))
            for own, rms in near
            if rms.mean is not None
        ],
        "matcher_lines": [(label, own.estimate(of.RMS_PX)) for label, own in matchers.items()],
        "bm_less_sgm": matchers["BM"].less(matchers["SGM"], of.RMS_PX) if both else None,
        "grid_lines": [
            (own.label, own.estimate(columns), own.estimate(missed).scaled(100.0)) for own in grids
        ],
        "grid_differences": [(own.label, own.less(grids[0], columns)) for own in grids[1:]],
        "nees": _nees(every, users),
        "contrast_lines": [
            (
                own.label,
                own.estimate(of.PIXEL_RMS),
                own.estimate(of.PIXEL_DENSITY).scaled(100.0),
                own.estimate(of.UNCOVERED).scaled(100.0),
            )
            for own in lines["contrasts"]
        ],
        "poses": every.tables["frames"]["pose"].nunique(),
        "seeds": len({run.seed for run in every.runs}),
    }


def _lead(own: of.Errors) -> tuple[of.Estimate, of.Estimate]:
    """RMS and bias of the depth round the depth that *The Stixel World* names, m."""
    near = own.between(*of.ROUND)
    return near.estimate(of.RMS), near.estimate(of.BIAS)


def _forest(users: Sequence[of.Errors]) -> Figure | None:
    """Bias of depth, disparity and height of each road user; no test covers them."""
    rows = [
        Row(own.label, "stixels", metric, unit, own.between(*ends).estimate(measure))
        for metric, unit, measure, ends in (
            (f"bias of the depth, {of.ROUND[0]:g} to {of.ROUND[1]:g} m", "m", of.BIAS, of.ROUND),
            ("bias of the disparity, all ranges", "px", of.PIXEL_BIAS, (0.0, 1e9)),
            ("bias of the height, all ranges", "m", of.HEIGHT_BIAS, (0.0, 1e9)),
        )
        for own in users
    ]
    return forest("answer_forest", rows)


def _near(own: of.Errors) -> dict[str, Any] | None:
    rms = own.estimate(of.RMS)
    if rms.mean is None:
        return None
    return {
        "verdict": "not clear"
        if rms.low is None or rms.low <= of.SW_STD < rms.high
        else "yes"
        if rms.high <= of.SW_STD
        else "no",
        "rms": rms,
        "gross_share": own.estimate(of.STIXEL_GROSS).mean,
        "bias": own.estimate(of.BIAS),
        "ratio": rms.scaled(1.0 / of.SW_STD),
        "rms_px": own.estimate(of.RMS_PX),
        "needed": of.needed_disparity(own.rig, of.SW_STD, of.SW_DEPTH),
        "own": {
            "square": own.estimate(of.SQUARE_RMS),
            "slanted or stepped": own.estimate(of.SLANTED_RMS),
        },
    }


def _nees(every: of.Errors, users: Sequence[of.Errors]) -> dict[str, Any] | None:
    nees = every.estimate(of.NEES)
    if nees.mean is None:
        return None
    by_range = []
    for user in users:
        for low, high in of.COARSE:
            own = user.between(low, high)
            if len(own.tables["every_stixel"]) >= of.LEAST and len(own.tables["stixels"]):
                mean = own.estimate(of.NEES).mean
                by_range.append((mean, f"{user.label}, {low:g}–{high:g} m"))
    return {
        "all": nees,
        "verdict": "not shown to be wrong"
        if nees.low is None or nees.low <= 1.0 <= nees.high
        else "too small"
        if nees.low > 1.0
        else "too large",
        "ends": (min(by_range), max(by_range)) if len(by_range) > 1 else None,
    }
