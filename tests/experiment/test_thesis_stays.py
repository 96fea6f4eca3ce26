"""The experiment of the thesis gives what it gave at revision 680ea67, whatever defaults change.

`golden/thesis_680ea67.json` are the `metrics.json` of that revision, of
`stixel run experiment=thesis measurement=fabricated road_user=… path=s_curve`. Not in it: loss,
which has another definition since, and metrics that are gone. The experiment starts
from radii of zero today (`prior.shape=none`, thesis (71b)), so the shapes of then are given here.
"""

import json
from pathlib import Path

import pytest

from stixel_cli import run

GOLDEN = json.loads((Path(__file__).parent / "golden" / "thesis_680ea67.json").read_text())
SHAPES = {"car": "rectangle", "cyclist": "ellipse", "pedestrian": "ellipse"}


@pytest.mark.parametrize("road_user", GOLDEN)
def test_the_thesis_stays(road_user):
    result = run(
        "experiment=thesis",
        "measurement=fabricated",
        f"road_user={road_user}",
        "path=s_curve",
        f"prior.shape={SHAPES[road_user]}",
    )
    expected = GOLDEN[road_user]
    found = {name: result.metrics[name] for name in expected}
    # As the reference cases: rounding differs from machine to machine. Where the filter has lost
    # its target (NEES / 2 of 70 and 325) it grows: between two processors up to 8e-4 of a value.
    tolerance = 1e-5 if road_user == "car" else 3e-3
    assert found == pytest.approx(expected, rel=tolerance, abs=1e-5)
