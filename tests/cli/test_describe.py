"""`stixel describe`: the schema's words on groups, options and keys."""

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import (
    describe_key,
    keys_of_option,
    known_keys,
    meaning_of_group,
    meaning_of_option,
)


def printed(capsys, *words):
    assert main(["describe", *words]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


TEXTS = {
    "tracker.sigma_f": [
        "standard deviation of the radius", "a number > 0 and ≤ 20", "0.1, from prior.sigma_f",
        "tracker=gp_ekf",
    ],
    "rig.width": ["default", "1242 (kitti)", "match"],
    "prior.sigma_f": ["tracker.sigma_f"],
    "tracker.mean_function": ["one of zero, class_radius"],
    "tracker": [*(f"tracker={one}" for one in group_options()["tracker"]), "read by",
                "Extended Kalman filter", "tracker.basis_points"],
    "stereo=bm": ["stereo.block_size"],
    "measurement/noise=stereo": ["measurement.noise.disparity_std"],
    "iou_mean": ["IoU of the outline, mean", "0 to 1", "better more", "iou_baseline of the same"],
    "nis_mean": ["near 1, as a factor", "below 0.33, above 3"],
    "track_lost": ["over runs track_loss_rate"],
}  # fmt: skip
"""Key, group, option or metric to what is said of it."""


@pytest.mark.parametrize("word", TEXTS)
def test_what_it_says(word, capsys):
    said = " ".join(printed(capsys, word).split())
    assert [text for text in TEXTS[word] if text not in said] == []
    assert word != "stereo=bm" or "stereo.disparities_at_full_size" not in said


NEAR = {
    **{"tracker.sigma": "tracker.sigma_f", "traker": "tracker", "tracker=pont": "tracker=point"},
    "NEES": "did you mean nees_position_mean or",
}


@pytest.mark.parametrize("word", NEAR)
def test_a_wrong_name_has_one_line(word, capsys):
    assert main(["describe", word]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and NEAR[word] in captured.err


def test_of_several_variants_the_default_comes_first():
    first, *others = describe_key("tracker.sigma_q")
    assert "tracker=gp_ekf" in first.belongs_to and others
    assert first.default == "1.5"


def test_all_groups(capsys):
    said = printed(capsys)
    assert all(f"\n{group} " in said for group in group_options() if "/" not in group)
    assert "\nseed " in said


def test_every_group_option_and_key_has_a_meaning_and_a_value():
    """The schema's docstrings are the help: none may be missing."""
    for group, options in group_options().items():
        assert "/" in group or meaning_of_group(group), group
        for option in options:
            assert meaning_of_option(group, option), (group, option)
            for one in keys_of_option(group, option):
                assert one.meaning, one
    for name in known_keys():
        for one in describe_key(name):
            assert one.meaning and one.range, one
            assert one.values, one
