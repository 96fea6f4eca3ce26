"""RQ1: are these stixels like those of *The Stixel World*?

Chapters, stage by stage, from the records of `evaluation.stage_errors`. Every number in the prose
is computed from the study's data.
"""

from collections.abc import Sequence
from itertools import pairwise

from stixel_cli.studies.inference import DRAWS
from stixel_cli.studies.prose import counted, quantity
from stixel_cli.studies.rq1.answer import answer, answer_table
from stixel_cli.studies.rq1.contrast import contrast_section
from stixel_cli.studies.rq1.disparity import disparity_section
from stixel_cli.studies.rq1.free_space import free_space_section
from stixel_cli.studies.rq1.gallery import gallery_section
from stixel_cli.studies.rq1.pool import EDGES, LEAST, Group, groups, pool, road_user
from stixel_cli.studies.rq1.setup import setup_section
from stixel_cli.studies.rq1.stixels import height_section, rigs_section, stixels_section
from stixel_cli.studies.types import Material, Paragraph, Section, StudyData
from stixel_cli.validation.stage_errors import BORDER, GROSS


def report(data: StudyData) -> Material:
    """The report of the study, from all of its sweeps."""
    users = groups(data.sweeps["ranges"], road_user)
    every = pool("all", [point for group in users for point in group.points])
    return Material(
        {
            "answer": tuple(answer(data, users, every)),
            "summary": answer_table(every),
            "sections": (
                _method(users),
                disparity_section(data, users),
                free_space_section(data, users),
                height_section(users),
                stixels_section(users),
                rigs_section(data),
                contrast_section(data),
                setup_section(data),
                gallery_section(data.sweeps["gallery"]),
            ),
        }
    )


def _method(users: Sequence[Group]) -> Section:
    first = users[0].points[0].configuration
    road, free_space, farthest = first.road, first.free_space, first.occupancy.farthest
    in_a_range = counted(_poses_in_a_range(users), "pose")
    return Section(
        "What is compared with what",
        (
            Paragraph(
                "Every road user comes straight towards the parked camera. The renderer tells "
                "depth and object of every pixel, and each stage is held against what it would "
                "have found if it were perfect. Errors are found minus true. A range is the true "
                "depth of the target's nearest surface in its frame, or of the surface behind one "
                "stixel."
            ),
            Paragraph(
                "Seeds renew the cameras' noise alone and share one rendering; pixels, columns and "
                "stixels of a frame share its errors. So what is counted as independent are poses: "
                "a road user at a range, with all of its seeds. Intervals in brackets are 95 % "
                f"percentiles of {DRAWS} bootstrap draws of poses, road user by road user; paired "
                "differences draw the same poses for both. Bands in figures are such intervals "
                f"too. A range of 5 m holds only {in_a_range} of a road user, of which percentiles "
                "tend to be too narrow: read bands, and brackets of a range, as how much poses "
                "differ, not as a test. Where all poses agree, as on no gross error at all, or "
                "there is one alone, nothing is known of how they scatter and no interval is "
                f"given. What is a mean of fewer than {LEAST} pixels, columns or stixels is not "
                "drawn."
            ),
            Paragraph(
                "Poses are not quite independent either. Those next to each other are "
                f"{quantity(first.path.sample_time, 's')} apart, and free space looks back at the "
                "frame before: what neighbours share makes intervals too short. What changes with "
                "the range is counted as scatter where all ranges are together, which makes them "
                "too long. Neither is allowed for."
            ),
            Paragraph(
                f"Disparity: found minus f B / z, pixel by pixel. An error above {GROSS:g} px is "
                "gross; bias and RMS are of the others. Density is the share of pixels with a "
                f"disparity. Pixels within {BORDER} px of another object are the border."
            ),
            Paragraph(
                "Free space: a column's true nearest obstacle is the depth by which the column's "
                f"pixels that stand {road.least_height:g} to {road.greatest_height:g} m above the "
                "road, nearest first, are as many as the least obstacle that free space is asked "
                f"for: {free_space.obstacle_height:g} m of height there, and "
                f"{free_space.obstacle_pixels:g} px. A column is missed if nothing is found there, "
                f"or more than {GROSS:g} px farther. Where something is found more than {GROSS:g} "
                "px nearer, or in a column without a true obstacle, it is “not asked for” if "
                f"something stands there within {GROSS:g} px, only less of it than the least "
                "obstacle (a wheel's rim, a foot) or beyond the grid's far end at "
                f"{farthest:g} m, and “invented” if nothing does (mostly what a matcher spreads "
                "beyond an object's edge)."
            ),
            Paragraph(
                "Stixels: on the target are those in at least half of whose columns it is the "
                "nearest obstacle; their truth is the median over those columns."
            ),
        ),
    )


def _poses_in_a_range(users: Sequence[Group]) -> int:
    """The most poses of a road user that any of the figures' ranges holds."""
    return max(
        len(set(group.poses[group.frames(low, high)].tolist()))
        for group in users
        for low, high in pairwise(EDGES)
    )
