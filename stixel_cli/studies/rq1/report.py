"""RQ1: are these stixels like those of *The Stixel World*?

Each stage is compared with its ideal result, from the records of `validation.stage_errors`.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from typing import Any

from stixel_cli.pictures.style import DEPTH_TICKS
from stixel_cli.report.blocks import Figure, Material
from stixel_cli.report.forest import Row, forest
from stixel_cli.report.intervals import DRAWS
from stixel_cli.report.scan_frame import stage_pictures
from stixel_cli.report.statistics import Statistic
from stixel_cli.studies.data import StudyData
from stixel_cli.studies.rq1 import errors as of
from stixel_cli.studies.rq1.figures import chapter_figures
from stixel_cli.studies.rq1.setup import setup_values, width_table, width_values
from stixel_cli.studies.rq1.tables import answer_table, chapter_tables
from stixel_cli.sweeps.results import SweepResult
from stixel_cli.validation.stage_errors import BORDER, GROSS
from stixel_cli.validation.stage_stixels import SQUARE

COLUMNS = {"ranges": "target", "matchers": "", "grids": "all", "rigs": "", "contrast": ""}
"""Sweep to the columns of the image whose errors are read."""

STATED = ("SW_STD", "SW_DEPTH", "ROUND", "EDGES", "LEAST")
"""Constants of `studies/rq1/errors.py` that the template states."""


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template."""
    at_any = {name: of.errors_of(data.sweeps[name].runs, own) for name, own in COLUMNS.items()}
    errors = {name: own.between(of.EDGES[0], of.EDGES[-1]) for name, own in at_any.items()}
    every, every_frame = errors["ranges"], at_any["matchers"].by(of.matcher)
    lines = {
        "users": every.by(of.road_user),
        "rigs": errors["rigs"].by(of.rig),
        "matchers": errors["matchers"].by(of.matcher),
        "grids": errors["grids"].by(of.grid),
    }
    by_contrast = {user.label: _by_contrast(user) for user in errors["contrast"].by(of.road_user)}
    by_width = width_values(data.sweeps["widths"])
    counts = {name: of.counts(own) for name, own in lines.items()}
    counts["contrast"] = of.counts(own for parts in by_contrast.values() for own in parts)
    return Material(
        {
            **answer_values(every, lines, _by_contrast(errors["contrast"])),
            **setup_values(data),
            "of": {name: getattr(of, name) for name in STATED},
            "draws": DRAWS,
            "gross": GROSS,
            "border": BORDER,
            "square": SQUARE,
            "depth_ticks": DEPTH_TICKS,
            "configuration": next(iter(every.runs.values())).configuration,
            "summary": answer_table(every),
            "poses_in_a_range": max(
                own.between(*ends).poses() for own in lines["users"] for ends in pairwise(of.EDGES)
            ),
            "counts": counts,
            "seeds_per_pose": {name: of.counts(own, poses=False) for name, own in lines.items()},
            "stixels_of": [(own.label, len(own.tables["stixels"])) for own in lines["users"]],
            "figures": chapter_figures(lines, every_frame, by_contrast),
            "tables": chapter_tables(lines, every_frame, by_contrast),
            "widths": by_width,
            "width_table": width_table(by_width),
            "gallery": _gallery(data.sweeps["gallery"]),
        }
    )


def _by_contrast(own: of.Errors) -> list[of.Errors]:
    """The runs by contrast, the least first."""
    return sorted(own.by(of.contrast), key=lambda part: float(part.label))


def _gallery(sweep: SweepResult) -> list[dict[str, Any]]:
    """A picture of the stages for each road user and pictured frame, with its caption's values."""
    firsts = {of.road_user(run): run for run in reversed(sweep.runs)}
    return [
        {
            "picture": picture,
            "user": user,
            "time": frame * run.configuration.path.sample_time,
            "seed": run.seed,
        }
        for user, run in sorted(firsts.items(), key=lambda item: item[1].index)
        for frame, picture in stage_pictures(f"gallery_{user}", run)
    ]


def answer_values(
    every: of.Errors, lines: Mapping[str, Sequence[of.Errors]], contrasts: Sequence[of.Errors]
) -> dict[str, Any]:
    """What the template's answer is filled with.

    Args:
        every: all road users of the default configuration together.
        lines: each of the `users`, and all of them by `rigs`, `matchers` and `grids`.
        contrasts: all road users by contrast, the least first.

    Returns:
        `leads`: label, RMS and bias round that depth of each road user; `forest`: plot of biases.
        `near`: the stixels round the depth that *The Stixel World* names, or None without any.
        `rig_lines`, `matcher_lines`, `grid_lines`, `contrast_lines`: values of each setting.
        `bm_less_sgm`, `grid_differences`: differences at the same poses.
        `nees`: mean square of error over stated std, with its least and greatest range.
    """
    users, grids = lines["users"], lines["grids"]
    matchers = {own.label: own for own in lines["matchers"]}
    both = {"SGM", "BM"} <= set(matchers)
    columns, missed = of.of_columns("px", root=True), of.of_columns("missed")
    rigs = [(own, own.between(*of.ROUND).estimate(of.RMS)) for own in lines["rigs"]]

    def percent(own: of.Errors, measure: of.Measure) -> Statistic:
        return own.estimate(measure).scaled(100.0)

    return {
        "leads": [
            (user.label, own.estimate(of.RMS), own.estimate(of.BIAS))
            for user, own in ((user, user.between(*of.ROUND)) for user in users)
        ],
        "forest": _forest(users),
        "near": _near(every.between(*of.ROUND)),
        "rig_lines": [
            (own.label, rms, of.needed_disparity(own.rig))
            for own, rms in rigs
            if rms.mean is not None
        ],
        "matcher_lines": [(label, own.estimate(of.RMS_PX)) for label, own in matchers.items()],
        "bm_less_sgm": matchers["BM"].less(matchers["SGM"], of.RMS_PX) if both else None,
        "grid_lines": [(own.label, own.estimate(columns), percent(own, missed)) for own in grids],
        "grid_differences": [(own.label, own.less(grids[0], columns)) for own in grids[1:]],
        "nees": _nees(every, users),
        "contrast_lines": [
            (
                own.label,
                own.estimate(of.PIXELS["RMS"]),
                percent(own, of.PIXELS["density"]),
                percent(own, of.UNCOVERED),
            )
            for own in (contrasts[0], contrasts[-1])
            if len(contrasts) > 1
        ],
        "poses": every.poses(),
        "seeds": len({run.seed for run in every.runs.values()}),
    }


def _forest(users: Sequence[of.Errors]) -> Figure | None:
    """Bias of depth, disparity and height of each road user; no test covers them."""
    rows = [
        Row(own.label, "stixels", metric, unit, own.between(*ends).estimate(measure))
        for metric, unit, measure, ends in (
            (f"bias of the depth, {of.ROUND[0]:g} to {of.ROUND[1]:g} m", "m", of.BIAS, of.ROUND),
            ("bias of the disparity, all ranges", "px", of.PIXELS["bias"], (0.0, 1e9)),
            ("bias of the height, all ranges", "m", of.bias("height"), (0.0, 1e9)),
        )
        for own in users
    ]
    return forest("answer_forest", rows)


def _near(own: of.Errors) -> dict[str, Any] | None:
    rms = own.estimate(of.RMS)
    if rms.mean is None:
        return None
    if rms.low is None or rms.low <= of.SW_STD < rms.high:
        verdict = "not clear"
    else:
        verdict = "yes" if rms.high <= of.SW_STD else "no"
    square, slanted = own.estimate(of.rms("square")), own.estimate(of.rms("slanted"))
    return {
        "verdict": verdict,
        "rms": rms,
        "gross_share": own.estimate(of.STIXEL_GROSS).mean,
        "bias": own.estimate(of.BIAS),
        "ratio": rms.scaled(1.0 / of.SW_STD),
        "rms_px": own.estimate(of.RMS_PX),
        "needed": of.needed_disparity(own.rig),
        "own": {"square": square, "slanted or stepped": slanted},
    }


def _nees(every: of.Errors, users: Sequence[of.Errors]) -> dict[str, Any] | None:
    nees = every.estimate(of.NEES)
    if nees.mean is None:
        return None
    by_range = []
    for user, (low, high) in product(users, of.COARSE):
        own = user.between(low, high)
        if len(own.tables["every_stixel"]) >= of.LEAST and len(own.tables["stixels"]):
            by_range.append((own.estimate(of.NEES).mean, f"{user.label}, {low:g}–{high:g} m"))
    if nees.low is None or nees.low <= 1.0 <= nees.high:
        verdict = "not shown to be wrong"
    else:
        verdict = "too small" if nees.low > 1.0 else "too large"
    ends = (min(by_range), max(by_range)) if len(by_range) > 1 else None
    return {"all": nees, "verdict": verdict, "ends": ends}
