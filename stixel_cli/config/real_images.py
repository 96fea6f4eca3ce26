"""The parameters from real images to scans, as `source=pair` composes them, without Hydra."""

from functools import cache
from types import SimpleNamespace

from stixel_cli.config import folders
from stixel_cli.measurements.stixels import StixelsParameters
from stixel_cli.stereo.sgm import SgmParameters
from stixel_cli.stixels import parameters

SCHEMAS = {
    "stereo": SgmParameters,
    "road": parameters.EstimatedRoad,
    "occupancy": parameters.PolarOccupancy,
    "free_space": parameters.FreeSpaceParameters,
    "height": parameters.HeightParameters,
    "extraction": parameters.ExtractionParameters,
    "measurement": StixelsParameters,
}
"""By group. Where `conf/` chooses another option by default, its schema belongs here."""


@cache
def real_image_parameters() -> SimpleNamespace:
    """The parameters of each of these groups, by name.

    They are the values of `conf/`, with what `conf/recorded.yaml` sets for real images; a test
    compares them with those of `compose(["source=pair", …])`.
    """
    suitable = folders.values_beside_groups("recorded")["source"]
    options = suitable["options"]
    suiting = folders.values_that_suit(suitable, options | {"source": "pair", "auto": False})
    sections = {
        group: folders.option_values(group, options.get(group) or folders.configured_option(group))
        for group in SCHEMAS
    }
    for key, value in suiting.items():
        group, _, name = key.partition(".")
        if group in sections:
            sections[group][name] = value
    return SimpleNamespace(**{group: SCHEMAS[group](**v) for group, v in sections.items()})
