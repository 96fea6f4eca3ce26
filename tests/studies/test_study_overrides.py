"""Overrides of a study whose sweeps have several trackers, measurements and paths."""

import pytest

from stixel_cli.errors import ConfigurationError
from stixel_cli.studies.overrides import overridden
from stixel_cli.sweeps.design import Axis, Design
from stixel_cli.sweeps.runs import design_runs


def axis(key, *values):
    return Axis((key,), tuple((f"{key}={value}",) for value in values))


TRACKING = Design(
    ("path.duration=1",),
    (
        axis("measurement", "simulated", "fabricated", "lidar"),
        axis("tracker", "gp_ekf", "point"),
        axis("seed", 0, 1),
    ),
)
STEREO_ONLY = Design(("measurement=simulated",), (axis("seed", 0, 1),))


def test_an_override_applies_to_the_runs_that_accept_it():
    text = "measurement/noise=constant"
    (design, alone), notes = overridden([TRACKING, STEREO_ONLY], [text], ["tracking", "stereo"])
    points = design_runs(design)
    assert len(points) == 3 * 2 * 2
    for point in points:
        assert (text in point.overrides) == (point.settings["measurement"] == "fabricated")
        assert list(point.settings) == ["measurement", "tracker", "seed"]
    assert alone == STEREO_ONLY
    assert [note.partition(": measurement/noise: there is")[0] for note in notes] == [
        f"{text}: left out of sweep tracking with measurement=simulated and measurement=lidar",
        f"{text}: left out of sweep stereo",
    ]


def test_a_key_inside_an_option_follows_it():
    texts = ["measurement.noise.range_std=0.2", "measurement/noise=constant"]
    (design,), notes = overridden([TRACKING], texts, ["tracking"])
    assert design.axes[0].steps == (
        ("measurement=simulated",),
        ("measurement=fabricated", *reversed(texts)),
        ("measurement=lidar",),
    )
    assert len(notes) == 2
    # An option of the group around it does not take it away, however they are ordered.
    for order in (["measurement=fabricated", texts[1]], [texts[1], "measurement=fabricated"]):
        (design,), notes = overridden([TRACKING], order, ["tracking"])
        assert {texts[1], "path.duration=1"} == set(design.fixed) and not notes


def test_a_value_out_of_range_is_refused():
    fabricated = Design(("measurement=fabricated", "measurement/noise=constant"), ())
    with pytest.raises(ConfigurationError, match="range_std: -1 is out of range"):
        overridden(
            [STEREO_ONLY, fabricated], ["measurement.noise.range_std=-1"], ["stereo", "rays"]
        )
    with pytest.raises(ConfigurationError, match="belongs to measurement=fabricated"):
        overridden([STEREO_ONLY], ["measurement/noise=constant"], ["stereo"])


def test_keys_that_distinguish_sweeps_cannot_be_overridden():
    rays = Design(("measurement=fabricated", "path=turn"), ())
    stereo = Design(("measurement=simulated", "path=turn"), ())
    with pytest.raises(ConfigurationError, match="measurement=fabricated in rays, measurement=sim"):
        overridden([rays, stereo], ["measurement=lidar"], ["rays", "stereo"])
    designs, notes = overridden([rays, stereo], ["path=circle"], ["rays", "stereo"])
    assert all("path=circle" in design.fixed for design in designs) and not notes
    # A sweep whose axes are derived keeps its own, and so stands in nobody's way.
    fitted = Design(("measurement=fabricated", "measurement/noise=fitted_car"), ())
    plain = Design(("measurement=fabricated", "measurement/noise=stereo"), ())
    (changed, kept), _ = overridden(
        [plain, fitted], ["measurement/noise=constant"], ["plain", "fitted"], derived=["fitted"]
    )
    assert "measurement/noise=constant" in changed.fixed
    assert kept == fitted
