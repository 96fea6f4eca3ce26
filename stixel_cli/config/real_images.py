"""The parameters from real images to scans, as `source=pair` composes them, without Hydra."""

from functools import cache
from types import SimpleNamespace

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

SCHEMAS = {
    "stereo": SgmParameters,
    "road": EstimatedRoad,
    "occupancy": PolarOccupancy,
    "free_space": FreeSpaceParameters,
    "height": HeightParameters,
    "extraction": ExtractionParameters,
    "measurement": StixelsParameters,
}
"""By group. Where `conf/` chooses another option by default, its schema belongs here."""


@cache
def real_image_parameters() -> SimpleNamespace:
    """The parameters of each of these groups, by name.

    They are the values of `conf/`, with what `conf/recorded.yaml` sets for real images; a test
    compares them with those of `compose(["source=pair", …])`.
    """
    suitable = values_beside_groups("recorded")["source"]
    options = suitable["options"]
    suiting = values_that_suit(suitable, options | {"source": "pair", "auto": False})
    sections = {
        group: option_values(group, options.get(group) or configured_option(group))
        for group in SCHEMAS
    }
    for key, value in suiting.items():
        group, _, name = key.partition(".")
        if group in sections:
            sections[group][name] = value
    return SimpleNamespace(**{group: SCHEMAS[group](**v) for group, v in sections.items()})
