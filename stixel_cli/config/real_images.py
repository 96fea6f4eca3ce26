"""The parameters from real images to scans, as `source=pair` composes them, without Hydra."""

from dataclasses import dataclass, fields
from functools import cache

from stixel_cli.config.folders import (
    configured_option,
    option_values,
    values_beside_groups,
    values_that_suit,
)
from stixel_cli.measurements.stixels import StixelsParameters
from stixel_cli.stereo.sgm import SgmParameters
from stixel_cli.stixels.parameters import (
    EstimatedRoad,
    ExtractionParameters,
    FreeSpaceParameters,
    HeightParameters,
    PolarOccupancy,
)


@dataclass(frozen=True)
class ImageParameters:
    """The parameters of the stages from images to scans, each by the name of its group."""

    stereo: SgmParameters
    road: EstimatedRoad
    occupancy: PolarOccupancy
    free_space: FreeSpaceParameters
    height: HeightParameters
    extraction: ExtractionParameters
    measurement: StixelsParameters


@cache
def real_image_parameters() -> ImageParameters:
    """The values of `conf/`, with what `conf/recorded.yaml` sets for real images.

    `compose(["source=pair", …])` has the same (`tests/test_stixels_of_pairs.py`); a run may change
    them.
    """
    suitable = values_beside_groups("recorded")["source"]
    options = suitable["options"]
    suiting = values_that_suit(suitable, options | {"source": "pair", "auto": False})
    sections = {}
    for field in fields(ImageParameters):
        group = field.name
        values = option_values(group, options.get(group) or configured_option(group))
        for key, value in suiting.items():
            if key.startswith(f"{group}."):
                values[key.removeprefix(f"{group}.")] = value
        sections[group] = field.type(**values)
    return ImageParameters(**sections)
