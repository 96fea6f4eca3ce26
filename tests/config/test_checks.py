import pytest

from stixel_cli.config.compose import compose
from stixel_cli.errors import ConfigurationError

IMPOSSIBLE = {
    "measurement=fabricated measurement.rays=641": "measurement.rays: must be ≤ rig.width",
    "path.start=[1,-3]": "path.start: the path starts behind the camera",
    "path.start=[0.5,1]": "path.start: must be at least 1.9 m from the camera, got 1.1 m",
    "path=waypoints path.points=[[0,1],[0,9]]": "path.points: must be at least 1.9 m from the "
    "camera, got 1 m",
    "path=waypoints path.points=[[0,9]]": "path.points: must have at least two points",
    "path=waypoints path.points=[]": "path.points: must have at least two points",
    "path.duration=0.05": "path.sample_time: must be <= path.duration (0.05 s), got 0.1 s",
    "path.duration=5 pictures.frames=[0,50]": "pictures.frames: must be <= 49, the last frame, "
    "got 50",
    "pictures.frames=[3,1]": "pictures.frames: must be increasing",
    "rig.focal_length=700": "rig.focal_length: set either",
    "rig.horizontal_fov=null": "rig.focal_length: set either",
    "rig.principal_v=480": "rig.principal_v: must be 0 to 479 (the image), got 480",
    "stereo.nearest=0.1": "stereo.nearest: at 0.1 m the disparity is 1663 px; it must be < "
    "rig.width (640)",
    "stereo=bm rig.height=64 rig.width=128 stereo.block_size=65": "stereo.block_size: must be "
    "smaller than the image, 128 × 64, got 65",
    "stereo.block_size=4": "stereo.block_size: must be odd",
    "road_user.mesh=/no/such/file.obj": "road_user.mesh: ",
    "road_user.mesh=/": "road_user.mesh: ",
    "road_user.mesh=": "road_user.mesh: ",
    "measurement.height_min=5 measurement.height_max=2.5": "measurement.height_max: must be > "
    "measurement.height_min",
    "prior.corner_radius=2": "prior.corner_radius: must be ≤",
    "experiment=thesis tracker=point": "prior.shape: tracker=point needs the shape of the class, "
    "got none",
    "prior.shape=none tracker.mean_function=class_radius": "prior.shape: "
    "tracker.mean_function=class_radius needs the shape",
}


@pytest.mark.parametrize("overrides", IMPOSSIBLE)
def test_the_impossible_is_refused(overrides):
    with pytest.raises(ConfigurationError) as error:
        compose(overrides.split())
    assert IMPOSSIBLE[overrides] in str(error.value)
    assert "\n" not in str(error.value)


def test_a_mesh_that_exists_is_taken(tmp_path):
    mesh = tmp_path / "a car.obj"
    mesh.touch()
    assert compose([f"road_user.mesh='{mesh}'"]).configuration.road_user.mesh == str(mesh)


def test_the_other_way_to_give_the_focal_length():
    rig = compose(["rig.focal_length=700", "rig.horizontal_fov=null"]).configuration.rig
    assert rig.focal == 700
