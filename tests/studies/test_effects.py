"""The table of what a variant of a tracker gains or loses, of a frame made by hand."""

import pandas as pd
import pytest

from stixel_cli.studies.accuracy.report import effect_rows


def run(user, prior, seed, iou, lost=0.0):
    row = {"road_user": user, "path": "turn", "seed": seed, "variant": prior}
    return row | {"iou_mean": iou, "track_lost": lost}


FRAME = pd.DataFrame(
    [
        run("car", "cyclist", 0, 0.5, lost=1.0),
        run("car", "cyclist", 1, 0.7, lost=1.0),
        run("car", "cyclist", 2, 0.5),
        run("car", "cyclist", 3, 0.7),
        run("car", "car", 0, 0.8),
        run("car", "car", 1, 0.9),
        run("car", "car", 2, 0.8),
        run("car", "car", 3, 0.9),
        run("cyclist", "car", 0, 0.6),
    ]
)


@pytest.fixture
def rows():
    measures = {"loss": ["iou_mean"], "": ["track_lost"]}
    return list(effect_rows(FRAME, "prior", lambda user: user, measures))


def test_an_effect_is_the_reference_minus_the_variant_of_the_same_runs(rows):
    wrong, right, _ = rows
    assert (wrong["road user"], wrong["prior"], wrong["n"]) == ("car", "cyclist", 4)
    assert wrong["mean IoU"] == pytest.approx(0.6)
    assert wrong["loss, mean IoU"] == pytest.approx(0.25)
    assert wrong["low loss, mean IoU"] < 0.25 < wrong["high loss, mean IoU"]
    assert wrong["track loss rate"] == pytest.approx(0.5)
    # The reference is compared with nothing, and `track_lost` has no effect.
    assert right["loss, mean IoU"] is None
    assert not any("loss, track" in column for column in right)


def test_without_runs_of_the_reference_there_is_no_effect(rows):
    assert rows[2]["mean IoU"] == pytest.approx(0.6)
    assert rows[2]["loss, mean IoU"] is None
