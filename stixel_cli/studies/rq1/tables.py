"""RQ1: the tables of the chapters and of the answer."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.tables import ends
from stixel_cli.studies.rq1 import errors as of
from stixel_cli.studies.rq1.figures import phase_error
from stixel_cli.validation.stage_errors import PHASES, ZONES, histogram_median

_OF_PIXELS = ("density %", "gross %", "bias px", "RMS px")
_OF_HEIGHT = {
    "top bias px": of.TOP_BIAS,
    "top RMS px": of.TOP_RMS,
    "base bias px": of.BASE_BIAS,
    "base RMS px": of.BASE_RMS,
    "height bias m": of.HEIGHT_BIAS,
    "height RMS m": of.HEIGHT_RMS,
}
_OF_OWN = {
    "own pixels, square, bias m": of.SQUARE_BIAS,
    "own pixels, square, RMS m": of.SQUARE_RMS,
    "own pixels, slanted, bias m": of.SLANTED_BIAS,
    "own pixels, slanted, RMS m": of.SLANTED_RMS,
}
_OF_DEPTH = {"front face bias m": of.BIAS, "front face RMS m": of.RMS, **_OF_OWN}
_OF_STIXELS = {
    "gross %": of.STIXEL_GROSS,
    **_OF_DEPTH,
    "error²/σ²": of.NEES,
    "within σ %": of.WITHIN_1,
    "lateral RMS m": of.LATERAL_RMS,
}
_AT_DEPTH = {
    **_OF_DEPTH,
    "height bias m": of.HEIGHT_BIAS,
    "error²/σ²": of.NEES,
    "width in no stixel %": of.UNSEEN,
}
_OF_CONTRAST = {
    "density %": of.PIXEL_DENSITY,
    "disparity RMS px": of.PIXEL_RMS,
    "stixel RMS px": of.RMS_PX,
    "columns in no stixel %": of.UNCOVERED,
}


def cells(own: of.Errors, measures: Mapping[str, of.Measure]) -> dict[str, Cell]:
    """Estimates and ends by column; columns that end in % are in per cent."""
    found: dict[str, Cell] = {}
    for name, measure in measures.items():
        found |= ends(name, own.estimate(measure).scaled(100.0 if name.endswith("%") else 1.0))
    return found


def range_tables(
    users: Sequence[of.Errors],
    matchers: Sequence[of.Errors],
    every_frame: Sequence[of.Errors],
    grids: Sequence[of.Errors],
    rigs: Sequence[of.Errors],
    contrasts: Mapping[str, Sequence[of.Errors]],
) -> dict[str, Table]:
    """The tables of the chapters, by name.

    Args:
        users: each road user.
        matchers: all road users by matcher, and `every_frame` at all distances.
        every_frame: see there.
        grids: by occupancy grid.
        rigs: by rig.
        contrasts: road user to its runs by contrast.
    """
    rows = {
        "disparity": _disparity(users),
        "matchers": map(_matcher, matchers, every_frame),
        "grids": _grids(grids),
        "height": _by_range(users, _OF_HEIGHT),
        "stixels": (
            row | {"stated σ m": own.estimate(of.SIGMA).mean}
            for own, row in zip(_ranges(users), _by_range(users, _OF_STIXELS), strict=True)
        ),
        "rigs": map(_rig, rigs),
        "depths": _depths(rigs),
        "contrast": (
            {"road user": user, "contrast": float(own.label), **cells(own, _OF_CONTRAST)}
            for user, parts in contrasts.items()
            for own in parts
        ),
    }
    return {name: Table.of(name, own) for name, own in rows.items()}


def _disparity(users: Sequence[of.Errors]) -> Iterator[dict[str, Cell]]:
    """Disparity on each road user, by zone and range."""
    for user in users:
        for zone in (of.INSIDE, of.AT_BORDER):
            for low, high in of.COARSE:
                own = user.between(low, high)
                yield {
                    "road user": user.label,
                    "zone": ZONES[zone].rpartition(" ")[2],
                    "range m": f"{low:g}–{high:g}",
                    "poses": own.poses(of.of_pixels(zone)[0]),
                    **_pixel_cells(own, zone),
                }


def _pixel_cells(own: of.Errors, zone: int) -> dict[str, Cell]:
    """Number of pixels, the measures of the disparity, and the median of all errors."""
    measures = of.of_pixels(zone)
    rows = own.rows(measures[0])
    median = histogram_median(np.sum(list(rows["histogram"]), axis=0)) if len(rows) else np.nan
    return {
        "pixels": int(rows["pixels"].sum()),
        **cells(own, dict(zip(_OF_PIXELS, measures, strict=True))),
        "median px": float(median) if np.isfinite(median) else None,
    }


def _matcher(own: of.Errors, every_frame: of.Errors) -> dict[str, Cell]:
    """Disparity and stixels at all ranges, of one matcher."""
    means = [phase_error(every_frame, of.INSIDE, i).mean for i in range(PHASES)]
    known = [mean for mean in means if mean is not None]
    measures = {
        "stixel RMS px": of.RMS_PX,
        "stixel RMS m": of.RMS,
        "columns in no stixel %": of.UNCOVERED,
    }
    return {
        "matcher": own.label,
        **_pixel_cells(own, of.INSIDE),
        "locking px": max(known) - min(known) if known else None,
        **cells(own, measures),
    }


def _grids(grids: Sequence[of.Errors]) -> Iterator[dict[str, Cell]]:
    """Columns of the grids, of the target and all, before and after the path."""
    for own in grids:
        for where, all_ in (("of the target", False), ("all", True)):
            for step in ("grid", "path"):
                measures = {
                    name: of.of_columns(value, step, root, all_)
                    for name, value, root in (
                        ("missed %", "missed", False),
                        ("below threshold %", "below threshold", False),
                        ("false positive %", "false positive", False),
                        ("bias px", "px", False),
                        ("RMS px", "px", True),
                        ("bias m", "m", False),
                        ("RMS m", "m", True),
                    )
                }
                begin = {"grid": own.label, "columns": where, "step": step}
                yield begin | cells(own, measures)


def _ranges(users: Sequence[of.Errors]) -> Iterator[of.Errors]:
    return (user.between(*ends) for user in users for ends in of.COARSE)


def _by_range(
    users: Sequence[of.Errors], measures: Mapping[str, of.Measure]
) -> Iterator[dict[str, Cell]]:
    """Measures of the stixels on each road user, by range."""
    labels = [f"{low:g}–{high:g}" for low, high in of.COARSE] * len(users)
    for label, own in zip(labels, _ranges(users), strict=True):
        yield {
            "road user": own.label,
            "range m": label,
            "poses": own.poses(of.STIXEL_GROSS),
            "stixels": len(own.tables["every_stixel"]),
            **cells(own, measures),
        }


def _rig(every: of.Errors) -> dict[str, Cell]:
    """Stixels of a rig against the std that The Stixel World states."""
    own, rig = every.between(*of.ROUND), every.rig
    needed = of.needed_disparity(rig, of.SW_STD, of.SW_DEPTH)
    found = own.estimate(of.RMS_PX)
    return {
        "rig": every.label,
        "image px": f"{rig.width} × {rig.height}",
        "f px": float(rig.focal),
        "B m": float(rig.baseline),
        "disparity there px": float(rig.disparity_from_depth(of.SW_DEPTH)),
        "needed px": needed,
        **ends("achieved RMS px", found),
        "achieved / needed": found.scaled(1.0 / needed).mean,
        **cells(own, _OF_DEPTH),
        "poses": own.poses(of.RMS_PX),
        "stixels": len(own.tables["every_stixel"]),
    }


def _depths(rigs: Sequence[of.Errors]) -> Iterator[dict[str, Cell]]:
    """Stixels of each rig and road user, and of all, at `DEPTHS`."""
    for rig in rigs:
        for user, part in (*((own.label, own) for own in rig.by(of.road_user)), ("all", rig)):
            for depth, (low, high) in of.DEPTHS.items():
                own = part.between(low, high)
                begin = {"rig": rig.label, "road user": user, "depth m": depth}
                begin |= {"poses": own.poses(of.BIAS), "stixels": len(own.tables["stixels"])}
                yield begin | cells(own, _AT_DEPTH)


def answer_table(every: of.Errors) -> Table:
    """Errors of each stage of the default configuration, over all road users and ranges."""
    grid, path = (of.of_columns("missed", step) for step in ("grid", "path"))
    rows = (
        ("disparity", "bias", "px", of.PIXEL_BIAS),
        ("disparity", "RMS", "px", of.PIXEL_RMS),
        ("disparity", "gross errors", "%", of.PIXEL_GROSS),
        ("disparity", "pixels with a disparity", "%", of.PIXEL_DENSITY),
        ("occupancy grid, without the path", "target's columns missed", "%", grid),
        ("free space", "target's columns missed", "%", path),
        ("stixels", "target's columns without a stixel", "%", of.UNCOVERED),
        ("stixels", "target's width that no stixel covers", "%", of.UNSEEN),
        ("stixels", "columns next to the target, per frame", "", of.OVERHANG),
        ("stixels", "gross errors", "%", of.STIXEL_GROSS),
        ("stixels", "disparity, RMS", "px", of.RMS_PX),
        ("stixels", "depth, front face, bias", "m", of.BIAS),
        ("stixels", "depth, front face, RMS", "m", of.RMS),
        ("stixels", "depth, own pixels, square, bias", "m", of.SQUARE_BIAS),
        ("stixels", "depth, own pixels, square, RMS", "m", of.SQUARE_RMS),
        ("stixels", "depth, own pixels, slanted, bias", "m", of.SLANTED_BIAS),
        ("stixels", "depth, own pixels, slanted, RMS", "m", of.SLANTED_RMS),
        ("stixels", "height, bias", "m", of.HEIGHT_BIAS),
        ("stixels", "height, RMS", "m", of.HEIGHT_RMS),
        ("stated σ", "mean square of error / σ", "", of.NEES),
        ("stated σ", "stixels within 1 σ", "%", of.WITHIN_1),
        ("stated σ", "stixels within 2 σ", "%", of.WITHIN_2),
    )
    return Table.of(
        "answer",
        (
            {
                "stage": stage,
                "measure": measure,
                "unit": unit,
                **ends("value", every.estimate(one).scaled(100.0 if unit == "%" else 1.0)),
            }
            for stage, measure, unit, one in rows
        ),
    )
