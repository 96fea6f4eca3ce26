"""Images to track, wall seconds per scan relative to the sample time, on one core and on two.

The reports of the studies have the CPU time on one core, and a lower bound for two. Here two
threads match the image pairs, and the rest runs as soon as a pair is matched, in order. The track
is the same. Free space and stixels take the pairs one by one, as a car would. The second test
does this with the pairs of a recording, clip 0005 of KITTI tracking, from its PNG files, where the
folder named by STIXEL_DATA has it.
"""

import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from small import IMAGES, sized

from stixel_cli.config.compose import compose
from stixel_cli.measurements.stixels import gather_scans
from stixel_cli.recordings.stereo_images import read_pairs
from stixel_cli.recordings.truth import recorded_motion, recorded_scenario
from stixel_cli.rendering.raycast import render
from stixel_cli.rendering.sensor_noise import add_sensor_noise
from stixel_cli.scene.ego import ego_motion
from stixel_cli.scene.path import build_scenario
from stixel_cli.stereo.matching import match
from stixel_cli.stixels.extraction import extract_stixels
from stixel_cli.stixels.free_space import find_free_space
from stixel_cli.tracking import gp_ekf
from stixel_cli.tracking.start import noisy_start


@pytest.fixture(scope="module")
def recorded():
    """Parameters, ego motion, start and image pairs of two seconds of the default run."""
    p = compose([f"path.duration={sized(2, 0.2)}", *IMAGES]).configuration
    ego = ego_motion(p.ego, p.path.duration, p.path.sample_time)
    scenario = build_scenario(ego, p.road_user, p.path)
    frames = range(len(ego.times))
    rendered = render(scenario, p.road_user, p.world, p.rig, p.renderer, frames)
    pairs = [add_sensor_noise(rendered, p.sensor, p.rig, range(k, k + 1), 0) for k in frames]
    return p, ego, noisy_start(scenario, p.start, 0), pairs.__getitem__


@pytest.fixture(scope="module")
def clip():
    """Parameters, ego motion, start and a reader of the pairs of a real clip."""
    folder = Path(os.environ.get("STIXEL_DATA", "../shared/data")) / "kitti_tracking"
    if not folder.is_dir():
        pytest.skip(f"no real clip: STIXEL_DATA names no folder with kitti_tracking ({folder})")
    of_clip = ("source=kitti_tracking", f"source.folder={folder}", "source.sequence=0005")
    composed = compose([*of_clip, "source.target=31"])
    p, files = composed.configuration, composed.recording
    times = files.count, p.source.sample_time
    ego = recorded_motion(files.pose_files, files.tables, *times, p.rig)
    scenario = recorded_scenario(ego, files.truth_files, p.rig, files.tables, files.target)

    def read(k):
        return read_pairs(files.images, range(k, k + 1))

    return p, ego, noisy_start(scenario, p.start, 0), read


def follow(recorded, cores):
    """Wall seconds per scan, and the states of the track."""
    p, ego, initial, pair_of = recorded
    count = len(ego.times)

    def matched_pair(k):
        pairs = pair_of(k)
        return pairs, match(pairs, p.stereo, p.rig, range(k, k + 1))

    started = time.perf_counter()
    stixels, free_space = [], None
    with ThreadPoolExecutor(2) as pool:
        matched = (map if cores == 1 else pool.map)(matched_pair, range(count))
        for k, (pairs, disparities) in enumerate(matched):
            frames = range(k, k + 1)
            free_space = find_free_space(
                disparities, ego, p.rig, p.road, p.occupancy, p.free_space, frames, free_space
            )
            stixels.append(
                extract_stixels(
                    disparities, free_space, pairs, p.rig, p.height, p.extraction, frames
                )
            )
    track = gp_ekf.track(
        gather_scans(stixels, ego, p.measurement, p.rig), initial, p.prior, p.tracker
    )
    return (time.perf_counter() - started) / count, track.means


def test_images_to_track_on_one_core_and_on_two(benchmark, recorded):
    sample_time = recorded[0].path.sample_time
    follow(recorded, 1)
    one, alone = min((follow(recorded, 1) for _ in range(sized(3, 1))), key=lambda found: found[0])
    _, together = benchmark.pedantic(follow, (recorded, 2), rounds=5)
    two = benchmark.stats.stats.min / len(recorded[1].times)
    assert np.array_equal(alone, together)
    benchmark.extra_info.update(
        one_core_over_sample_time=round(one / sample_time, 3),
        two_cores_over_sample_time=round(two / sample_time, 3),
        speed_up=round(one / two, 2),
    )
    print("\n", benchmark.extra_info)


def test_files_of_a_real_clip_to_track_on_one_core_and_on_two(benchmark, clip):
    cpu = time.process_time()
    follow(clip, 1)
    cpu = (time.process_time() - cpu) / len(clip[1].times)
    one, alone = min((follow(clip, 1) for _ in range(sized(2, 1))), key=lambda found: found[0])
    _, together = benchmark.pedantic(follow, (clip, 2), rounds=3)
    two = benchmark.stats.stats.min / len(clip[1].times)
    assert np.array_equal(alone, together)
    benchmark.extra_info.update(
        cpu_seconds_per_pair=round(cpu, 3),
        pairs_per_second_on_one_core=round(1.0 / one, 1),
        pairs_per_second_on_two_cores=round(1.0 / two, 1),
    )
    print("\n", benchmark.extra_info)
