"""RQ1: are these stixels like those of *The Stixel World*?

Chapters, stage by stage, from the records of `validation.stage_errors`.
"""

from collections.abc import Sequence
from itertools import pairwise

from stixel_cli.studies.inference import DRAWS
from stixel_cli.studies.rq1.answer import answer, answer_table
from stixel_cli.studies.rq1.contrast import contrast_section
from stixel_cli.studies.rq1.disparity import disparity_section
from stixel_cli.studies.rq1.free_space import free_space_section
from stixel_cli.studies.rq1.gallery import gallery_section
from stixel_cli.studies.rq1.pool import EDGES, LEAST, Group, groups, pool, road_user
from stixel_cli.studies.rq1.setup import setup_section
from stixel_cli.studies.rq1.stixels import height_section, rigs_section, stixels_section
from stixel_cli.studies.types import Material, StudyData
from stixel_cli.validation.stage_errors import BORDER, GROSS


def report(data: StudyData) -> Material:
    """What the template is filled with, from all sweeps."""
    users = groups(data.sweeps["ranges"], road_user)
    every = pool("all", [point for group in users for point in group.runs])
    first = users[0].runs[0].configuration
    return Material(
        {
            "answer": tuple(answer(data, users, every)),
            "summary": answer_table(every),
            "road": first.road,
            "free_space": first.free_space,
            "farthest": first.occupancy.farthest,
            "sample_time": first.path.sample_time,
            "poses_in_a_range": _poses_in_a_range(users),
            "draws": DRAWS,
            "least": LEAST,
            "gross": GROSS,
            "border": BORDER,
            "sections": (
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


def _poses_in_a_range(users: Sequence[Group]) -> int:
    """The largest number of poses of a road user in any of the figures' ranges."""
    return max(
        len(set(group.poses[group.frames(low, high)].tolist()))
        for group in users
        for low, high in pairwise(EDGES)
    )
