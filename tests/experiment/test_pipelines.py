"""How the stages are wired: what may see the truth, and what the table says of them."""

import inspect
import sys
from importlib.metadata import packages_distributions
from pkgutil import resolve_name

import pytest

from stixel_cli.config.compose import compose
from stixel_cli.engine.code_hash import CodeIndex
from stixel_cli.engine.stage import GIVEN
from stixel_cli.experiment.stages import TABLE, pictured_frames, pipeline_stages, scan_count

TRUTH = {"scenario", "render"}
MAY_SEE_TRUTH = {"render", "expose", "start", "scores", "stage_errors", "point_errors"}


def stages_of(measurement):
    composed = compose([f"measurement={measurement}"])
    return {stage.name: stage for stage in pipeline_stages(composed.configuration)}


def test_past_the_images_only_start_scores_and_pictures_see_the_truth():
    for stage in stages_of("simulated").values():
        if stage.name not in MAY_SEE_TRUTH and not stage.name.endswith("_pictures"):
            assert TRUTH.isdisjoint(stage.inputs.values()), stage.name


def test_past_its_returns_a_lidars_scans_see_no_truth_and_the_returns_see_no_noise():
    stages = stages_of("lidar")
    assert stages["scans"].inputs == {"returns": "cast_lidar", "ego_motion": "ego_motion"}
    assert stages["cast_lidar"].seed is None
    assert set(stages["cast_lidar"].settings) == {"road_user", "world", "scanner", "camera_field"}


@pytest.mark.parametrize("measurement", ["simulated", "fabricated", "lidar"])
def test_the_track_sees_no_truth_and_does_not_depend_on_pictures(measurement):
    stages = stages_of(measurement)
    assert stages["track"].inputs == {"scans": "scans", "initial": "start"}
    for stage in stages.values():
        assert not any(source.endswith("_pictures") for source in stage.inputs.values())


@pytest.mark.parametrize("row", TABLE)
def test_the_version_of_every_package_that_a_stage_reaches_is_in_its_key(row):
    definition = TABLE[row]
    distributions = packages_distributions()
    # Bounds that are checked before anything runs; and a library that Open3D only has to find.
    passive = {"annotated_types", "libusb_package"}
    for function in definition.functions.values():
        outside = CodeIndex().hash(function).outside - sys.stdlib_module_names - passive
        for module in outside:
            assert set(distributions[module]) & set(definition.packages), (function, module)


@pytest.mark.parametrize("row", TABLE)
def test_a_stages_arguments_are_those_of_every_function_it_may_call(row):
    definition = TABLE[row]
    wired = [
        stage
        for measurement in ("simulated", "fabricated", "lidar")
        for stage in stages_of(measurement).values()
        if stage.function in definition.functions.values()
    ]
    assert wired, "no pipeline uses this row"
    given = {*wired[0].inputs, *wired[0].settings, *GIVEN[definition.pattern]}
    given |= {"seed"} if definition.seeded else set()
    for function in definition.functions.values():
        parameters = inspect.signature(resolve_name(function)).parameters.values()
        needed = {p.name for p in parameters if p.default is p.empty}
        assert needed <= given, function
        assert given <= {p.name for p in parameters}, function


def test_pictured_frames_are_those_chosen_or_four_spread_over_the_run():
    assert pictured_frames(compose().configuration) == (12, 37, 62, 87)
    chosen = compose(["pictures.frames=[3,99]"]).configuration
    assert pictured_frames(chosen) == (3, 99)
    short = compose(["path.duration=0.2"]).configuration
    assert (scan_count(short), pictured_frames(short)) == (2, (0, 1))
