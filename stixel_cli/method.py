"""The whole method, from the scene to the scores, in plain calls: the place to start reading.

`stixel run` does the same through a graph of cached stages (`pipelines/stixels.yaml`), on one
thread for BLAS. With one thread here (`OPENBLAS_NUM_THREADS=1` before NumPy is imported) the bytes
are the same; with more, the results differ by about 1e-12. Nothing is cached and nothing is drawn.
"""

from stixel_cli.evaluation.evaluate import evaluate
from stixel_cli.evaluation.scores import Scores
from stixel_cli.measurements.scans import Scans
from stixel_cli.measurements.stixels import gather_scans
from stixel_cli.rendering.raycast import render
from stixel_cli.rendering.sensor_noise import add_sensor_noise
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.stereo.matching import match
from stixel_cli.stixels.extraction import extract_stixels
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.start import noisy_start
from stixel_cli.tracking.track import Track


def follow_road_user(p, seed: int) -> tuple[Scans, Track, Scores]:
    """Scans, track and scores of one road user, seen by one stereo rig.

    `p` has the parameters of each step by the name of its group: `stixel_cli.compose()` gives
    them, or any object with these attributes. `seed` decides all random numbers.
    """
    # The truth: where the ego car and the target are at each k, and the target's contour.
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    frames = range(len(ego.times))

    # The images. From here on nothing sees the truth until the scores.
    rendered = render(scenario, p.road_user, p.world, p.rig, p.renderer, frames)
    pairs = add_sensor_noise(rendered, p.sensor, p.rig, frames, seed)

    # Disparity; occupancy grid and free space; height and stixels; points on the ground.
    disparities = match(pairs, p.stereo, p.rig, frames)
    free_space = find_free_space(
        disparities, ego, p.rig, p.road, p.occupancy, p.free_space, frames, previous=None
    )
    stixels = extract_stixels(disparities, free_space, pairs, p.rig, p.height, p.extraction, frames)
    scans = gather_scans([stixels], ego, p.measurement, p.rig)

    # The tracker starts at the noisy truth. Its track is compared with the truth.
    initial = noisy_start(scenario, p.start, seed)
    track = gp_ekf.track(scans, initial, p.prior, p.tracker)
    return scans, track, evaluate(track, scenario, scans)
