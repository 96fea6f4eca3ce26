"""The parameters of stixels of real images, without Hydra: for the calls from Python."""

from functools import cache
from types import SimpleNamespace

from stixel_cli.config import folders


@cache
def real_image_parameters() -> SimpleNamespace:
    """The parameters of the groups from real images to scans, as `source=pair` composes them.

    They are the values of `conf/`, with what `conf/recorded.yaml` sets for real images; a test
    compares them with those of `compose(["source=pair", …])`. Hydra is not imported.
    """
    from stixel_cli.measurements.stixels import StixelsParameters
    from stixel_cli.stereo.matching import SgmParameters
    from stixel_cli.stixels import parameters

    # Where `conf/` chooses another option by default, its schema belongs here.
    schemas = {
        "stereo": SgmParameters,
        "road": parameters.EstimatedRoad,
        "occupancy": parameters.OccupancyParameters,
        "free_space": parameters.FreeSpaceParameters,
        "height": parameters.HeightParameters,
        "extraction": parameters.ExtractionParameters,
        "measurement": StixelsParameters,
    }
    suitable = folders.values_beside_groups("recorded")["source"]
    options = suitable["options"]
    suiting = folders.values_that_suit(suitable, options | {"source": "pair", "auto": False})
    sections = {
        group: folders.option_values(group, options.get(group) or folders.configured_option(group))
        for group in schemas
    }
    for key, value in suiting.items():
        group, _, name = key.partition(".")
        if group in sections:
            sections[group][name] = value
    return SimpleNamespace(**{group: schemas[group](**v) for group, v in sections.items()})
