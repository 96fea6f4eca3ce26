"""Overrides of a study whose sweeps have several trackers, measurements and paths."""

import pytest

from stixel_cli.border import TYPED
from stixel_cli.config.compose import Composer
from stixel_cli.config.overrides import parse
from stixel_cli.errors import ConfigurationError
from stixel_cli.studies.plan import overridden
from stixel_cli.sweeps.design import Axis, Design, design_runs


def axis(key, *values):
    return Axis((key,), tuple((parse(f"{key}={value}", TYPED),) for value in values))


def texts_of(design):
    return [one.text for one in design.fixed]


def fixed(*texts):
    """A design without axes."""
    return Design(tuple(parse(text, TYPED) for text in texts), ())


TRACKING = Design(
    (parse("path.duration=1", TYPED),),
    (
        axis("measurement", "stixels", "fabricated", "lidar"),
        axis("tracker", "gp_ekf", "point"),
        axis("seed", 0, 1),
    ),
)
STEREO_ONLY = Design((parse("measurement=stixels", TYPED),), (axis("seed", 0, 1),))


def test_an_override_applies_to_sweeps_all_of_whose_runs_accept_it():
    rays = Design((parse("measurement=fabricated", TYPED),), (axis("seed", 0, 1),))
    text = "measurement/noise=constant"
    sweeps = [TRACKING, STEREO_ONLY, rays]
    designs, notes = overridden(sweeps, [text], ["tracking", "stereo", "rays"])
    assert designs[:2] == sweeps[:2] and text in texts_of(designs[2])
    assert len(design_runs(designs[2], Composer())) == 2
    (note,) = notes
    assert note.startswith(f"{text}: left out of sweeps tracking and stereo: measurement/noise: ")


def test_a_key_inside_an_option_follows_it():
    texts = ["measurement.noise.range_std=0.2", "measurement/noise=constant"]
    for order in (["measurement=fabricated", *texts], [*texts, "measurement=fabricated"]):
        (design,), notes = overridden([TRACKING], order, ["tracking"])
        assert {*texts, "path.duration=1"} == set(texts_of(design)) and not notes
        assert design.swept[0].text == "measurement=fabricated"


def test_several_values_need_an_axis():
    with pytest.raises(ConfigurationError, match=r"tracker.basis_points: is on no axis here"):
        overridden([STEREO_ONLY], ["tracker.basis_points=20,30"], ["stereo"])
    (design,), _ = overridden([TRACKING], ["tracker=point,contour", "seed=3,4"], ["tracking"])
    assert design.axes[1:] == (axis("tracker", "point", "contour"), axis("seed", 3, 4))


def test_a_value_out_of_range_is_refused():
    fabricated = fixed("measurement=fabricated", "measurement/noise=constant")
    with pytest.raises(ConfigurationError, match="range_std: -1 is out of range"):
        overridden(
            [STEREO_ONLY, fabricated], ["measurement.noise.range_std=-1"], ["stereo", "rays"]
        )
    with pytest.raises(ConfigurationError, match="belongs to measurement=fabricated"):
        overridden([STEREO_ONLY], ["measurement/noise=constant"], ["stereo"])


def test_keys_that_distinguish_sweeps_cannot_be_overridden():
    rays = fixed("measurement=fabricated", "path=turn")
    stereo = fixed("measurement=stixels", "path=turn")
    names = "measurement=fabricated in rays, measurement=stixels in stereo"
    with pytest.raises(ConfigurationError, match=names):
        overridden([rays, stereo], ["measurement=lidar"], ["rays", "stereo"])
    designs, notes = overridden([rays, stereo], ["path=circle"], ["rays", "stereo"])
    assert all("path=circle" in texts_of(design) for design in designs) and not notes
    # A sweep whose axes are derived keeps its own, and so stands in nobody's way.
    fitted = fixed("measurement=fabricated", "measurement/noise=fitted_car")
    plain = fixed("measurement=fabricated", "measurement/noise=stereo")
    (changed, kept), _ = overridden(
        [plain, fitted], ["measurement/noise=constant"], ["plain", "fitted"], derived=["fitted"]
    )
    assert "measurement/noise=constant" in texts_of(changed)
    assert kept == fitted
