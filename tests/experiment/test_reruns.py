"""Settings that compute stages again; and the thesis stays."""

import json
from pathlib import Path

import pytest

from stixel_cli import run
from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import experiment_graph

AFTER_SCANS = {"track", "scores", "track_pictures", "path_pictures", "error_pictures"}


def changed(*words):
    """The stages whose keys are others with `words`."""
    before, after = (experiment_graph(compose(line)) for line in ([], words))
    stages = [name for name in before.stages if before.of_stage(name)]
    return {one for one in stages if before.of_stage(one)[0].key != after.of_stage(one)[0].key}


def test_a_setting_or_the_seed_recomputes_its_stage_and_what_depends_on_it():
    assert changed() == set()
    assert changed("tracker.sigma_q=0.7") == AFTER_SCANS
    again = changed("seed=5")
    assert {"add_sensor_noise", "match", "start", "track"} <= again
    assert again.isdisjoint({"scenario", "render", "ego_motion"})


GOLDEN = json.loads((Path(__file__).parent / "golden" / "thesis_680ea67.json").read_text())
SHAPES = {"car": "rectangle", "cyclist": "ellipse", "pedestrian": "ellipse"}


@pytest.mark.parametrize("road_user", GOLDEN)
def test_the_thesis_stays(road_user):
    words = ("experiment=thesis", "measurement=fabricated", "path=s_curve")
    result = run(*words, f"road_user={road_user}", f"prior.shape={SHAPES[road_user]}")
    expected = GOLDEN[road_user]
    found = {name: result.metrics[name] for name in expected}
    # As the reference cases: rounding differs from machine to machine. Where the filter has lost
    # its target (NEES / 2 of 70 and 325) it grows: between two processors up to 8e-4 of a value.
    tolerance = 1e-5 if road_user == "car" else 3e-3
    assert found == pytest.approx(expected, rel=tolerance, abs=1e-5)
