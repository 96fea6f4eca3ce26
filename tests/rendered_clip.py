"""A rendered clip, written by `stixel export`, and the results of a run of its images."""

import dataclasses

import numpy as np
import pytest

RUN = ("path=depart", "path.duration=0.3", "ego=turning", "rig.width=240", "rig.height=160")
RUN += ("pictures.frames=[]", "executor=threads")


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    """Folder of a rendered clip of three pairs, written by `stixel export`."""
    from stixel_cli.cli.app import main  # not at once, see `conftest.py`

    folder = tmp_path_factory.mktemp("rendered")
    assert main(["run", *RUN, "--results", str(folder), "--name", "run"]) == 0
    export = ["export", str(folder / "run"), "--format", "kitti", "--output"]
    assert main([*export, str(folder / "clip")]) == 0
    return folder / "clip"


def results_of_run(composition, *names):
    """The results of these stages, one chunk of each."""
    from stixel_cli.experiment.stages import computed_stages

    with computed_stages(composition, list(names)) as (_, load):
        return [load(name)[0] for name in names]


def assert_same(ours, theirs):
    for field in dataclasses.fields(theirs):
        one, other = getattr(ours, field.name), getattr(theirs, field.name)
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes(), field.name
        assert np.asarray(one).dtype == np.asarray(other).dtype, field.name
