"""The parameters of stixels of real images, without Hydra: for the calls from Python."""

from functools import cache
from types import SimpleNamespace

from stixel_cli.config.choice import compose_options, with_values
from stixel_cli.config.folders import values_beside_groups, values_that_suit


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
    suitable = values_beside_groups("recorded")["source"]
    facts = suitable["options"] | {"source": "pair", "auto": False}
    plain = with_values(
        compose_options(suitable["options"]).plain, values_that_suit(suitable, facts)
    )
    return SimpleNamespace(**{group: schema(**plain[group]) for group, schema in schemas.items()})
