"""The table of sub-pixel phases of `stixel_cli.stereo.matching`, and the accuracy of each way.

`python bench/phase_table.py` fits the table on seeds 1000 and 1001 of world and sensor noise and
prints it, then the errors on seed 0 and on the real pairs in the folder of STIXEL_DATA.
"""

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from bench_cost import call
from small import IMAGES, sized

from stixel_cli.config.compose import compose
from stixel_cli.experiment.stages import pipeline_stages
from stixel_cli.geometry.rig import Rig
from stixel_cli.rendering.frames import TARGET_ID, StereoPairs
from stixel_cli.rendering.images import ImageStack
from stixel_cli.stereo.matching import PHASE_TABLE, match
from stixel_cli.validation.stage_errors import GROSS

APPROACH = [
    *("path=approach", "path.start=[-0.5,52.5]", "path.heading=-90.0", "path.speed=5.0"),
    *("path.sample_time=0.25", "path.duration=9.75"),
]
RIGS = sized(("default", "long_range", "kitti"), ("default",))
USERS = sized(("car", "pedestrian"), ("car",))
WAYS = ("parabola", "phase_table")
KITTI = Rig(1242, 375, None, 721.5377, 609.5593, 172.854, 0.5327254, 1.65, 0.0, None)
DATA = Path(os.environ.get("STIXEL_DATA", Path(__file__).parents[1] / "../shared/data"))
FAR = 25.0


def rendered_frames(overrides, frames):
    """Configuration, pairs, true disparities px, ids and depths m of some frames of a run."""
    composition = compose([*APPROACH, *overrides, *IMAGES])
    configuration = composition.configuration
    stages = {stage.name: stage for stage in pipeline_stages(composition)}
    scenario = call(stages, "scenario", ego_motion=call(stages, "ego_motion"))
    for k in frames:
        one = {"frames": range(k, k + 1)}
        rendered = call(stages, "render", scenario=scenario, **one)
        pairs = call(stages, "add_sensor_noise", rendered=rendered, **one)
        depth = rendered.depth(0)
        true = configuration.rig.disparity_from_depth(depth)
        yield configuration, pairs, true, rendered.ids[0], depth


def matched(configuration, pairs, subpixel):
    stereo = replace(configuration.stereo, subpixel=subpixel)
    frames = range(pairs.first, pairs.first + 1)
    return match(pairs, stereo, configuration.rig, frames)


def fit() -> np.ndarray:
    """The table (16,), 1/16 px: true phases are even, so it is the cumulated histogram."""
    count = np.zeros(16)
    for rig in RIGS:
        for seed in sized((1000, 1001), (1000,)):
            for user in USERS:
                run = f"rig={rig} road_user={user} seed={seed} world.seed={seed}".split()
                for configuration, pairs, *_ in rendered_frames(run, sized((8, 18, 30), (18,))):
                    raw = matched(configuration, pairs, "parabola").raw(0)
                    phases = raw[raw >= 0] % 16
                    count += np.bincount(phases, minlength=16) / len(phases)
    # Left and right of a whole pixel are alike.
    share = (count + np.roll(count[::-1], 1)) / (2 * count.sum())
    upper = np.cumsum(share[1:8]) - 0.5 * share[1:8] + 0.5 * share[0]
    half = np.rint(16 * upper)
    return np.concatenate([[0], half, [8], 16 - half[::-1]]).astype(int)


def rms(errors: np.ndarray) -> float:
    """RMS without gross errors, px."""
    return float(np.sqrt(np.mean(np.square(errors[np.abs(errors) <= GROSS]))))


def rendered_errors(rig: str) -> dict[str, dict[str, np.ndarray]]:
    """Errors px of each way on seed 0: of all pixels, of the target, and of it beyond `FAR` m."""
    errors = {way: {"all": [], "target": [], "far target": []} for way in WAYS}
    frames = sized(range(2, 38, 4), (14,))
    for user in USERS:
        run = f"rig={rig} road_user={user} seed=0".split()
        for configuration, pairs, true, ids, depth in rendered_frames(run, frames):
            inside = cv2.erode((ids == TARGET_ID).astype(np.uint8), np.ones((5, 5))) > 0
            zones = {"all": np.isfinite(depth), "target": inside}
            zones["far target"] = inside & (depth >= FAR)
            for way in WAYS:
                error = matched(configuration, pairs, way).pixels(0) - true
                for zone, pixels in zones.items():
                    errors[way][zone].append(error[pixels & np.isfinite(error)])
    return {
        way: {zone: np.concatenate(parts) for zone, parts in zones.items()}
        for way, zones in errors.items()
    }


def real_errors() -> dict[str, np.ndarray]:
    """Errors px of each way on KITTI 2012 and 2015, without each pair's median; empty if absent."""
    errors = {way: [] for way in WAYS}
    names = [f"{year}/000000_10_{{}}.png" for year in ("kitti2012", "kitti2015")]
    for name in names:
        files = [DATA / name.format(part) for part in ("left", "right", "disp_occ")]
        if not all(file.is_file() for file in files):
            continue
        views = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files[:2]]
        pairs = StereoPairs(0, *(ImageStack.from_images([view]) for view in views))
        true = cv2.imread(str(files[2]), cv2.IMREAD_UNCHANGED) / 256.0
        height, width = views[0].shape  # The two benchmarks have images of their own sizes.
        rig = replace(KITTI, width=width, height=height)
        configuration = replace(compose(["rig=kitti"]).configuration, rig=rig)
        for way in WAYS:
            error = (matched(configuration, pairs, way).pixels(0) - true)[true > 0]
            error = error[np.isfinite(error)]
            errors[way].append(error - np.median(error))
    return {way: np.concatenate(parts) for way, parts in errors.items() if parts}


def accuracy() -> list[tuple[str, str, dict[str, float]]]:
    """Rows of images, zone, and RMS px by way."""
    rows = []
    for rig in RIGS:
        errors = rendered_errors(rig)
        for zone in ("all", "target", "far target"):
            rows.append((f"rig={rig}", zone, {way: rms(errors[way][zone]) for way in WAYS}))
    real = real_errors()
    if real:
        rows.append(("KITTI 2012, 2015", "all", {way: rms(real[way]) for way in WAYS}))
    return rows


if __name__ == "__main__":
    print("fitted :", tuple(fit().tolist()), "\nshipped:", PHASE_TABLE)
    print("RMS px without gross errors, and relative to the parabola")
    for images, zone, found in accuracy():
        first = found[WAYS[0]]
        values = "  ".join(f"{way} {x:.4f} ({x / first:.3f})" for way, x in found.items())
        print(f"{images:17} {zone:10}  {values}")
