"""RQ1: the tables of the chapters and of the answer."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from stixel_cli.report.blocks import Cell, Table
from stixel_cli.report.tables import ends
from stixel_cli.studies.rq1 import errors as of
from stixel_cli.studies.rq1.figures import phase_error
from stixel_cli.validation.stage_errors import PHASES, ZONES, histogram_median

_OF_HEIGHT = {
    "top bias px": of.bias("top"),
    "top RMS px": of.rms("top"),
    "base bias px": of.bias("base"),
    "base RMS px": of.rms("base"),
    "height bias m": of.bias("height"),
    "height RMS m": of.rms("height"),
}
_OF_DEPTH = {
    "front face bias m": of.BIAS,
    "front face RMS m": of.RMS,
    "own pixels, square, bias m": of.bias("square"),
    "own pixels, square, RMS m": of.rms("square"),
    "own pixels, slanted, bias m": of.bias("slanted"),
    "own pixels, slanted, RMS m": of.rms("slanted"),
}
_OF_STIXELS = {
    "gross %": of.STIXEL_GROSS,
    **_OF_DEPTH,
    "error²/σ²": of.NEES,
    "within σ %": of.WITHIN_1,
    "lateral RMS m": of.rms("lateral"),
}
_OF_MATCHER = {
    "stixel RMS px": of.RMS_PX,
    "stixel RMS m": of.RMS,
    "columns in no stixel %": of.UNCOVERED,
}
_AT_DEPTH = {
    **_OF_DEPTH,
    "height bias m": of.bias("height"),
    "error²/σ²": of.NEES,
    "width in no stixel %": of.UNSEEN,
}
_OF_CONTRAST = {
    "density %": of.PIXELS["density"],
    "disparity RMS px": of.PIXELS["RMS"],
    "stixel RMS px": of.RMS_PX,
    "columns in no stixel %": of.UNCOVERED,
}


def cells(own: of.Errors, measures: Mapping[str, of.Measure]) -> dict[str, Cell]:
    """Statistics and ends by column; columns that end in % are in per cent."""
    found: dict[str, Cell] = {}
    for name, measure in measures.items():
        found |= ends(name, own.estimate(measure).scaled(100.0 if name.endswith("%") else 1.0))
    return found


def chapter_tables(
    lines: Mapping[str, Sequence[of.Errors]],
    every_frame: Sequence[of.Errors],
    contrasts: Mapping[str, Sequence[of.Errors]],
) -> dict[str, Table]:
    """The tables of the chapters, by name.

    Args:
        lines: each of the `users`, and all of them by `matchers`, `grids` and `rigs`.
        every_frame: by matcher, at all distances.
        contrasts: road user to its runs by contrast.
    """
    ranges = [
        ({"road user": user.label, "range m": f"{low:g}–{high:g}"}, user.between(low, high))
        for user in lines["users"]
        for low, high in of.COARSE
    ]
    rows = {
        "disparity": _disparity(lines["users"]),
        "matchers": map(_matcher, lines["matchers"], every_frame),
        "grids": _grids(lines["grids"]),
        "height": (_stixels(*part, _OF_HEIGHT) for part in ranges),
        "stixels": (
            _stixels(*part, _OF_STIXELS) | {"stated σ m": part[1].estimate(of.SIGMA).mean}
            for part in ranges
        ),
        "rigs": map(_rig, lines["rigs"]),
        "depths": _depths(lines["rigs"]),
        "contrast": (
            {"road user": user, "contrast": float(own.label), **cells(own, _OF_CONTRAST)}
            for user, parts in contrasts.items()
            for own in parts
        ),
    }
    return {name: Table.of(name, own) for name, own in rows.items()}


def _disparity(users: Sequence[of.Errors]) -> Iterator[dict[str, Cell]]:
    """Disparity on each road user, by zone and range."""
    for user, zone, (low, high) in product(users, (of.INSIDE, of.AT_BORDER), of.COARSE):
        own = user.between(low, high)
        yield {
            "road user": user.label,
            "zone": ZONES[zone].rpartition(" ")[2],
            "range m": f"{low:g}–{high:g}",
            "poses": own.poses(of.of_pixels(zone)["density"]),
            **_pixel_cells(own, zone),
        }


def _pixel_cells(own: of.Errors, zone: int) -> dict[str, Cell]:
    """Number of pixels, the measures of the disparity, and the median of all errors."""
    measures = of.of_pixels(zone)
    rows = own.rows(measures["density"])
    median = histogram_median(np.sum(list(rows["histogram"]), axis=0)) if len(rows) else np.nan
    units = {"density": "%", "gross": "%", "bias": "px", "RMS": "px"}
    return {
        "pixels": int(rows["pixels"].sum()),
        **cells(own, {f"{name} {units[name]}": one for name, one in measures.items()}),
        "median px": float(median) if np.isfinite(median) else None,
    }


def _matcher(own: of.Errors, every_frame: of.Errors) -> dict[str, Cell]:
    """Disparity and stixels at all ranges, of one matcher."""
    means = [phase_error(every_frame, of.INSIDE, i).mean for i in range(PHASES)]
    known = [mean for mean in means if mean is not None]
    return {
        "matcher": own.label,
        **_pixel_cells(own, of.INSIDE),
        "locking px": max(known) - min(known) if known else None,
        **cells(own, _OF_MATCHER),
    }


def _grids(grids: Sequence[of.Errors]) -> Iterator[dict[str, Cell]]:
    """Columns of the grids, of the target and all, before and after the path."""
    where = {"of the target": False, "all": True}
    for own, (columns, all_), step in product(grids, where.items(), ("grid", "path")):
        measures = {
            f"{value} %": of.of_columns(value, step, all_=all_)
            for value in ("missed", "below threshold", "false positive")
        }
        for unit in ("px", "m"):
            measures[f"bias {unit}"] = of.of_columns(unit, step, False, all_)
            measures[f"RMS {unit}"] = of.of_columns(unit, step, True, all_)
        yield {"grid": own.label, "columns": columns, "step": step} | cells(own, measures)


def _stixels(
    begin: dict[str, Cell], own: of.Errors, measures: Mapping[str, of.Measure]
) -> dict[str, Cell]:
    """Measures of the stixels on a road user in a range."""
    counts = {"poses": own.poses(of.STIXEL_GROSS), "stixels": len(own.tables["every_stixel"])}
    return begin | counts | cells(own, measures)


def _rig(every: of.Errors) -> dict[str, Cell]:
    """Stixels of a rig against the std that The Stixel World states."""
    own, rig = every.between(*of.ROUND), every.rig
    needed, achieved = of.needed_disparity(rig), own.estimate(of.RMS_PX)
    return {
        "rig": every.label,
        "image px": f"{rig.width} × {rig.height}",
        "f px": float(rig.focal),
        "B m": float(rig.baseline),
        "disparity there px": float(rig.disparity_from_depth(of.SW_DEPTH)),
        "needed px": needed,
        **ends("achieved RMS px", achieved),
        "achieved / needed": achieved.scaled(1.0 / needed).mean,
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
        ("disparity", "bias", "px", of.PIXELS["bias"]),
        ("disparity", "RMS", "px", of.PIXELS["RMS"]),
        ("disparity", "gross errors", "%", of.PIXELS["gross"]),
        ("disparity", "pixels with a disparity", "%", of.PIXELS["density"]),
        ("occupancy grid, without the path", "target's columns missed", "%", grid),
        ("free space", "target's columns missed", "%", path),
        ("stixels", "target's columns without a stixel", "%", of.UNCOVERED),
        ("stixels", "target's width that no stixel covers", "%", of.UNSEEN),
        ("stixels", "columns next to the target, per frame", "", of.OVERHANG),
        ("stixels", "gross errors", "%", of.STIXEL_GROSS),
        ("stixels", "disparity, RMS", "px", of.RMS_PX),
        ("stixels", "depth, front face, bias", "m", of.BIAS),
        ("stixels", "depth, front face, RMS", "m", of.RMS),
        ("stixels", "depth, own pixels, square, bias", "m", of.bias("square")),
        ("stixels", "depth, own pixels, square, RMS", "m", of.rms("square")),
        ("stixels", "depth, own pixels, slanted, bias", "m", of.bias("slanted")),
        ("stixels", "depth, own pixels, slanted, RMS", "m", of.rms("slanted")),
        ("stixels", "height, bias", "m", of.bias("height")),
        ("stixels", "height, RMS", "m", of.rms("height")),
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
