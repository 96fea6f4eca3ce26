"""RQ1: are these stixels like those of *The Stixel World*?

Each stage is compared with its ideal result, from the records of `validation.stage_errors`.
"""

from itertools import pairwise
from typing import Any

from stixel_cli.pictures.style import DEPTH_TICKS
from stixel_cli.report.blocks import Material
from stixel_cli.report.statistics import DRAWS
from stixel_cli.studies.data import StudyData, StudySweep
from stixel_cli.studies.rq1 import errors as of
from stixel_cli.studies.rq1 import figures
from stixel_cli.studies.rq1.answer import answer_values
from stixel_cli.studies.rq1.records import errors_of
from stixel_cli.studies.rq1.setup import setup_values
from stixel_cli.studies.rq1.tables import answer_table, range_tables
from stixel_cli.studies.rq1.widths import width_table, width_values
from stixel_cli.studies.stage_pictures import stage_pictures
from stixel_cli.validation.stage_errors import BORDER, GROSS
from stixel_cli.validation.stage_stixels import SQUARE


def report(data: StudyData) -> Material:
    """Values, tables and figures of the template."""
    at_any = {
        name: errors_of(data.sweeps[name].runs, columns)
        for name, columns in (
            *(("ranges", "target"), ("matchers", ""), ("grids", "all")),
            *(("rigs", ""), ("contrast", "")),
        )
    }
    errors = {name: own.between(of.EDGES[0], of.EDGES[-1]) for name, own in at_any.items()}
    every = errors["ranges"]
    lines = {
        "users": every.by(of.road_user),
        "rigs": errors["rigs"].by(of.rig),
        "matchers": errors["matchers"].by(of.matcher),
        "grids": errors["grids"].by(of.grid),
    }
    every_frame = at_any["matchers"].by(of.matcher)
    by_contrast = {
        user.label: sorted(user.by(lambda run: f"{of.contrast(run):g}"), key=_number)
        for user in errors["contrast"].by(of.road_user)
    }
    contrasts = sorted(errors["contrast"].by(lambda run: f"{of.contrast(run):g}"), key=_number)
    first_and_last = contrasts[:: len(contrasts) - 1] if len(contrasts) > 1 else []
    by_width = width_values(data.sweeps["widths"])
    first = every.runs[0].configuration
    drawn = [lines[name] for name in ("users", "matchers", "grids", "rigs")]
    zones = {"inside the target": of.INSIDE, "inside other obstacles": of.OTHERS}
    return Material(
        {
            **answer_values(every, lines["users"], lines | {"contrasts": first_and_last}),
            **setup_values(data),
            "summary": answer_table(every),
            "edges": of.EDGES,
            "round": of.ROUND,
            "depth": of.SW_DEPTH,
            "std": of.SW_STD,
            "depth_ticks": DEPTH_TICKS,
            "road": first.road,
            "free_space": first.free_space,
            "farthest": first.occupancy.farthest,
            "sample_time": first.path.sample_time,
            "poses_in_a_range": max(
                own.between(*ends).tables["frames"]["pose"].nunique()
                for own in lines["users"]
                for ends in pairwise(of.EDGES)
            ),
            "draws": DRAWS,
            "least": of.LEAST,
            "gross": GROSS,
            "border": BORDER,
            "square": SQUARE,
            "counts": {name: of.counts(own) for name, own in lines.items()}
            | {"contrast": of.counts(own for parts in by_contrast.values() for own in parts)},
            "seeds_per_pose": {name: of.seeds(own) for name, own in lines.items()},
            "stixels_of": [(own.label, len(own.tables["stixels"])) for own in lines["users"]],
            "figures": {
                **figures.range_figures(*drawn),
                "locking": figures.locking(every_frame, zones),
                "normalised": figures.normalised(lines["users"]),
                "contrast": figures.contrast(by_contrast),
            },
            "tables": range_tables(
                lines["users"],
                lines["matchers"],
                every_frame,
                lines["grids"],
                lines["rigs"],
                by_contrast,
            ),
            "widths": by_width,
            "width_table": width_table(by_width),
            "gallery": gallery(data.sweeps["gallery"]),
        }
    )


def _number(own) -> float:
    return float(own.label)


def gallery(sweep: StudySweep) -> list[dict[str, Any]]:
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
