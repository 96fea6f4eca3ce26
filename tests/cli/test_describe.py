"""`stixel describe`: the schema's words on groups, options and keys."""

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.descriptions import (
    describe_key,
    keys_of_option,
    meaning_of_group,
    meaning_of_option,
)
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import known_keys


def printed(capsys, *words):
    assert main(["describe", *words]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


def test_a_key(capsys):
    said = printed(capsys, "tracker.sigma_f")
    for text in ("standard deviation of the radius", "m", "a number > 0 and ≤ 20", "track"):
        assert text in said
    assert "0.1, from prior.sigma_f" in said
    assert "tracker=gp_ekf" in said


def test_a_key_with_a_value_for_each_option(capsys):
    said = printed(capsys, "rig.width")
    assert "default" in said and "1242 (kitti)" in said and "match" in said


def test_who_reads_a_key_by_reference(capsys):
    (one,) = describe_key("prior.sigma_f")
    assert one.followers == ["tracker.sigma_f"]
    assert "tracker.sigma_f" in printed(capsys, "prior.sigma_f")


def test_of_several_variants_the_default_comes_first():
    first, *others = describe_key("tracker.sigma_q")
    assert "tracker=gp_ekf" in first.belongs_to and others
    assert first.default == "1.5"


def test_words(capsys):
    said = printed(capsys, "tracker.mean_function")
    assert "one of zero, class_radius" in said


def test_a_group(capsys):
    said = printed(capsys, "tracker")
    for option in group_options()["tracker"]:
        assert f"tracker={option}" in said
    assert "Extended Kalman filter" in said and "tracker.basis_points" in said
    assert "read by" in said


def test_an_option(capsys):
    said = printed(capsys, "stereo=bm")
    assert "stereo.block_size" in said and "stereo.disparities_at_full_size" not in said
    assert "measurement.noise.disparity_std" in printed(capsys, "measurement/noise=stereo")


def test_a_wrong_name_may_mean_a_metric(capsys):
    assert main(["describe", "NEES"]) == 2
    assert "did you mean nees_position_mean or" in capsys.readouterr().err


def test_all_groups(capsys):
    said = printed(capsys)
    assert all(f"\n{group} " in said for group in group_options() if "/" not in group)
    assert "\nseed " in said


@pytest.mark.parametrize(
    ("word", "near"),
    [
        ("tracker.sigma", "tracker.sigma_f"),
        ("traker", "tracker"),
        ("tracker=pont", "tracker=point"),
    ],
)
def test_a_wrong_name_has_one_line(word, near, capsys):
    assert main(["describe", word]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and near in captured.err


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


def test_a_metric_is_described_with_unit_better_values_and_baseline(capsys):
    assert main(["describe", "iou_mean"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for text in (
        "IoU of the outline, mean",
        "0 to 1",
        "better more",
        "iou_baseline of the same run",
    ):
        assert text in said
    assert main(["describe", "nis_mean"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "near 1, as a factor" in said and "below 0.33, above 3" in said
    assert main(["describe", "track_lost"]) == 0
    assert "over runs track_loss_rate" in " ".join(capsys.readouterr().out.split())
