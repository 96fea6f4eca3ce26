"""RQ1: are these stixels like those of *The Stixel World*?

Chapters, stage by stage, from the records of `evaluation.stage_errors`. Every number in the prose
is computed from the study's data.
"""

from stixel_cli.evaluation.stage_errors import BORDER, GROSS
from stixel_cli.studies.inference import DRAWS
from stixel_cli.studies.nouns import Findings, Paragraph, Section, StudyData
from stixel_cli.studies.rq1.answer import answer
from stixel_cli.studies.rq1.contrast import contrast_section
from stixel_cli.studies.rq1.disparity import disparity_section
from stixel_cli.studies.rq1.free_space import free_space_section
from stixel_cli.studies.rq1.gallery import gallery_section
from stixel_cli.studies.rq1.pool import groups, road_user
from stixel_cli.studies.rq1.setup import setup_section
from stixel_cli.studies.rq1.stixels import height_section, rigs_section, stixels_section


def report(data: StudyData) -> Findings:
    """The report of the study, from all of its parts."""
    users = groups(data.parts["ranges"], road_user)
    return Findings(
        answer=tuple(answer(data, users)),
        sections=(
            _method(),
            disparity_section(data, users),
            free_space_section(data, users),
            height_section(users),
            stixels_section(users),
            rigs_section(data),
            contrast_section(data),
            setup_section(data),
            gallery_section(data.parts["gallery"]),
        ),
        files={},
    )


def _method() -> Section:
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
                "differences draw the same poses for both. Lines without a band are means over all "
                "that is there, and tell by how they jump from range to range how sure they are."
            ),
            Paragraph(
                f"Disparity: found minus f B / z, pixel by pixel. An error above {GROSS:g} px is "
                "gross; bias and RMS are of the others. Density is the share of pixels with a "
                f"disparity. Pixels within {BORDER} px of another object are the border."
            ),
            Paragraph(
                "Free space: a column's true nearest obstacle is the depth by which the column's "
                "pixels that stand above the road's margin and below the clearance height, nearest "
                "first, are as many as the least obstacle that the grid is asked for. A column is "
                f"missed if nothing is found there, or more than {GROSS:g} px farther; it is "
                f"invented if something is found where nothing is, or above {GROSS:g} px nearer."
            ),
            Paragraph(
                "Stixels: on the target are those in at least half of whose columns it is the "
                "nearest obstacle; their truth is the median over those columns."
            ),
        ),
    )
