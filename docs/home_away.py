"""Write the README's table of trackers at home and away: STIXEL_DATA=DIR python docs/home_away.py

Cars only. At home, rendered scenes of the generator from whose other seeds `contour` learned its
classes; away, recordings in DIR: `kitti_tracking` and `pandaset`. Finished runs are cached.
"""

import os
from pathlib import Path

import pandas as pd

from stixel_cli import sweep
from stixel_cli.answers.runs import Answer, Runs

README = Path(__file__).parents[1] / "README.md"
BEGIN, END = "<!-- from docs/home_away.py -->", "<!-- end -->"
TRACKERS = ("contour", "gp_ekf", "box", "no_data")
METRICS = {"iou_box_mean": "box IoU", "nees_position_mean": "NEES / 2"}
SEEDS = range(4)
ROAD_Z = -0.25
"""Of PandaSet's street in the tables' column z, m, as in pipelines/studies/robustness_real.yaml."""


def home(measurement: str) -> Runs:
    """Drawn cars on three paths of 5 s; each seed has its own car."""
    swept = sweep(
        {"measurement": measurement, "path.duration": 5, "road_user.shape_seed": "${seed}"},
        path=("turn", "crossing", "approach"),
        tracker=TRACKERS,
        seed=SEEDS,
    )
    return Runs(swept.frame(), ("path", "tracker", "seed"))


def clip(data: Path) -> Runs:
    """Cars of KITTI tracking's clip 0005."""
    swept = sweep(
        {"source": "kitti_tracking", "source.folder": data / "kitti_tracking"},
        {"source.sequence": "0005", "source.target": (31, 0, 1), "road_user": "car"},
        tracker=TRACKERS,
        seed=SEEDS,
    )
    return Runs(swept.frame(), ("source.target", "tracker", "seed"))


def pandaset(data: Path) -> Runs:
    """Cars of a dense street, scanned by a lidar: a row a recording, tracker and seed."""
    frames = []
    for folder in sorted((data / "pandaset").glob("car-*")):
        files = {
            f"measurement.{key}": folder / f"{name}.csv"
            for key, name in (("path", "scans"), ("ego", "ego"), ("truth", "truth"))
        }
        known = files | {"measurement.road_z": ROAD_Z}
        swept = sweep("experiment=pandaset", known, tracker=TRACKERS, seed=SEEDS)
        frames.append(swept.frame().assign(recording=folder.name))
    return Runs(pd.concat(frames, ignore_index=True), ("recording", "tracker", "seed"))


def cell(answers: dict[str, Answer], tracker: str) -> str:
    """Box IoU with its interval, NEES / 2, and the share of lost tracks."""
    iou, nees = (answers[name].table.loc[tracker] for name in METRICS)
    interval = f"{iou['mean']:.2f} [{iou['low']:.2f}, {iou['high']:.2f}]"
    return f"{interval}, {nees['mean']:.2g}, {100 * iou['lost_share']:.0f} %"


def table(columns: dict[str, tuple[Runs, str]]) -> str:
    """A Markdown table, one row a tracker; of each column its runs and the units of its means."""
    answers = {
        name: {metric: runs.ask(compare="tracker", over=over, metric=metric) for metric in METRICS}
        for name, (runs, over) in columns.items()
    }
    lines = [f"| tracker | {' | '.join(columns)} |", f"|---|{'---|' * len(columns)}"]
    lines += [
        f"| `{tracker}` | {' | '.join(cell(found, tracker) for found in answers.values())} |"
        for tracker in TRACKERS
    ]
    return "\n".join(lines)


def main() -> None:
    """Replace what is between the two comments of the README."""
    data = Path(os.environ["STIXEL_DATA"])
    seeds, lidar_away = f"({len(SEEDS)} seeds)", pandaset(data)
    text = table(
        {
            f"stixels, home {seeds}": (home("stixels"), "seed"),
            f"stixels, away {seeds}": (clip(data), "seed"),
            f"lidar, home {seeds}": (home("lidar_64"), "seed"),
            f"lidar, away ({lidar_away.frame['recording'].nunique()} cars)": (
                lidar_away,
                "recording",
            ),
        }
    )
    before, rest = README.read_text(encoding="utf-8").split(BEGIN)
    after = rest.split(END)[1]
    README.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
