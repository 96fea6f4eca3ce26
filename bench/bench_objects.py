"""Clusters of stixels by DBSCAN and HDBSCAN against true objects: `python bench/bench_objects.py`.

It prints a table. An object is found if one cluster has more than 80 % of
its stixels, and more than 80 % of that cluster's stixels are the object's. Rendered: the target and
all things of the scene with four stixels or more, from the rendered ids. Clip 0005 of KITTI
tracking, where the folder named by STIXEL_DATA has it: stixels inside the labelled boxes, enlarged
by 0.4 m across and 0.4 m + 3 % of the depth along.
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from sklearn.cluster import DBSCAN, HDBSCAN
from small import sized

from stixel_cli.config.compose import compose
from stixel_cli.engine.execute import execute
from stixel_cli.engine.store import open_store
from stixel_cli.experiment.stages import experiment_graph
from stixel_cli.geometry.pose import target_from_world
from stixel_cli.measurements.clusters import cluster, distances
from stixel_cli.recordings.tables import read_labels
from stixel_cli.rendering.frames import TARGET_ID
from stixel_cli.stixels.types import Stixels

DATA = Path(os.environ.get("STIXEL_DATA", Path(__file__).parents[1] / "../shared/data"))
SCENES = (
    "path=turn world=roadside road_user=car seed=1000",
    "path=crossing world=roadside road_user=pedestrian seed=1001 ego=straight",
    "path=crossing world=street road_user=cyclist seed=1002",
    "path=approach world=roadside road_user=car seed=1003 rig=kitti",
)
LEAST = 4


def near(points: np.ndarray, covariances: np.ndarray, **options) -> np.ndarray:
    """HDBSCAN with the distances of the stage."""
    with_distances = HDBSCAN(metric="precomputed", copy=True, **options)
    return with_distances.fit_predict(distances(points, covariances))


METHODS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "DBSCAN, as the stage": cluster,
    "DBSCAN, 0.8 m": lambda points, _: DBSCAN(eps=0.8, min_samples=2).fit_predict(points),
    "HDBSCAN, clusters of 3": lambda points, r: near(points, r, min_cluster_size=3, min_samples=2),
    "HDBSCAN, clusters of 6": lambda points, r: near(points, r, min_cluster_size=6, min_samples=2),
    "HDBSCAN, m, clusters of 3": lambda points, _: HDBSCAN(
        min_cluster_size=3, copy=True
    ).fit_predict(points),
}

Frame = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Points (n, 2) m, covariances (n, 2, 2) m² and the true object (n,), 0 for none."""


def results(words: list[str], *names: str) -> tuple:
    """The composition, and all chunks of the stages `names`."""
    composition = compose([*words, "executor=threads"])
    configuration = composition.configuration
    store, graph = open_store(configuration.cache), experiment_graph(composition)
    execute(graph, list(names), store, executor=configuration.executor)
    loaded = [[store.load(node.key) for node in graph.of_stage(name)] for name in names]
    return composition, *loaded


def frames_of(configuration, chunks: list[Stixels], truth) -> Iterator[Frame]:
    for number, chunk in enumerate(chunks):
        inside = chunk.inside(configuration.measurement.gates)
        for i in range(len(chunk.offsets) - 1):
            rows = np.arange(*chunk.offsets[i : i + 2])[inside[chunk.rows(i)]]
            yield chunk.points_ego[rows], chunk.covariances_ego[rows], truth(number, i, rows)


def rendered(words: str) -> Iterator[Frame]:
    given = [*words.split(), f"path.duration={sized(4, 1)}", "path.sample_time=1.0"]
    given += sized([], ["rig.width=320", "rig.height=240"])
    composition, chunks, images = results(given, "stixels", "render")

    def truth(number: int, i: int, rows: np.ndarray) -> np.ndarray:
        chunk, ids = chunks[number], images[number].ids[i]
        found = []
        for s in rows:
            own = ids[chunk.top[s] : chunk.base[s] + 1, chunk.left[s] : chunk.right[s]].ravel()
            own = own[own >= TARGET_ID]
            found.append(np.bincount(own).argmax() if len(own) else 0)
        return np.array(found, dtype=np.int64)

    return frames_of(composition.configuration, chunks, truth)


def recorded() -> Iterator[Frame]:
    source = ["source=kitti_tracking", f"source.folder={DATA / 'kitti_tracking'}"]
    source += ["source.sequence=0005", "road_user=car", "start.range=[5,60]"]
    composition, chunks = results(source, "stixels")
    recording = composition.recording
    labels = read_labels(recording.label_files, recording.tables)

    def truth(number: int, i: int, rows: np.ndarray) -> np.ndarray:
        chunk = chunks[number]
        found = np.zeros(len(rows), dtype=np.int64)
        middles = 0.5 * (chunk.left[rows] + chunk.right[rows])
        for track, own in labels.items():
            for j in np.flatnonzero(own.frames == recording.first + chunk.first + i):
                if own.occluded[j] > 1:
                    continue
                place = own.places[j] - np.array(recording.tables.left_camera)
                pose = np.array([place[0], place[2], -own.yaws[j]])
                _, width, length = own.sizes[j]
                along, across = np.abs(target_from_world(chunk.points_ego[rows], pose)).T
                inside = (along <= 0.5 * length + 0.4 + 0.03 * place[2]) & (
                    across <= 0.5 * width + 0.4
                )
                seen = (middles >= own.boxes[j][0]) & (middles <= own.boxes[j][2])
                found[inside & seen] = TARGET_ID + track
        return found

    return frames_of(composition.configuration, chunks, truth)


def score(method, frames: list[Frame], wanted) -> tuple[int, float, float, float]:
    """Number of objects, share found, mean share of an object and of a cluster."""
    rows = []
    for points, covariances, truth in frames:
        labels = method(points, covariances)
        for one in np.unique(truth[truth >= TARGET_ID]):
            own = truth == one
            if not wanted(one) or own.sum() < LEAST:
                continue
            clusters = labels[own & (labels >= 0)]
            best = np.bincount(clusters).argmax() if len(clusters) else -2
            both = float(np.sum(own & (labels == best)))
            rows.append((both / own.sum(), both / max(1, np.sum(labels == best))))
    shares = np.array(rows)
    return len(rows), np.mean((shares > 0.8).all(axis=1)), *shares.mean(axis=0)


def main() -> None:
    """Print one table per kind of frames."""
    scenes = [frame for words in SCENES[: sized(None, 1)] for frame in rendered(words)]
    kinds = {
        "target, rendered": (scenes, lambda one: one == TARGET_ID),
        "other things, rendered": (scenes, lambda one: one != TARGET_ID),
    }
    if (DATA / "kitti_tracking").is_dir():
        kinds["labels of clip 0005"] = (list(recorded()), lambda one: True)
    print("| objects | method | n | found | share of the object | share of the cluster |")
    print("|---|---|---|---|---|---|")
    for kind, (frames, wanted) in kinds.items():
        for name, method in METHODS.items():
            count, found, whole, pure = score(method, frames, wanted)
            print(f"| {kind} | {name} | {count} | {found:.2f} | {whole:.2f} | {pure:.2f} |")


if __name__ == "__main__":
    main()
