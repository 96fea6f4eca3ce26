"""A small study made for the tests: its file, and its module."""

import copy
import functools
import operator

import pandas as pd
import yaml

from stixel_cli.studies.report import Material, with_columns

FEW = {"measurement": "fabricated", "path.duration": 0.3, "executor": "threads"}
"""Three scans, computed without starting a process."""

FIRST = {
    "fixed": FEW,
    "axes": {"tracker": ["gp_ekf", "point"]},
    "zipped": [{"road_user": ["car", "pedestrian"], "path": ["turn", "crossing"]}],
    "seeds": 2,
    "results": ["scans", "track"],
}
SECOND = {"fixed": FEW, "seeds": 1, "results": ["scans"], "derive": "widths"}
TRACKERS = {"heading": "One & only", "note": "By <hand>.", "sweeps": "first", "by": "road_user"}
TRACKERS |= {"metrics": ["iou_mean", "points_of_scans"]}
WIDTHS = {"sweeps": "second", "compare": "tracker.sigma_f", "metrics": "iou_mean"}
TOY = {"title": "A <toy> & its title", "question": "What comes of it?", "module": "toy.py"}
TOY |= {"sweeps": {"first": FIRST, "second": SECOND}}
TOY |= {"questions": {"trackers": TRACKERS, "widths": WIDTHS}}
TOY |= {"text": "<b> IoU. {trackers}.\n\nBy width:\n{widths}.\n"}


def changed(where, value):
    """The file's content with one entry changed, or left out if `value` is None."""
    content = copy.deepcopy(TOY)
    *outer, last = where
    inner = functools.reduce(operator.getitem, outer, content)
    inner[last] = value
    if value is None:
        del inner[last]
    return content


SEEN = []
"""The data that the report was made from."""


def write(folder, content=TOY, name="toy"):
    """The study's file, with its module next to it."""
    file = folder / f"{name}.yaml"
    text = content if isinstance(content, str) else yaml.safe_dump(content, sort_keys=False)
    file.write_text(text, encoding="utf-8")
    module = "from study_toy import columns, material, widths\n"
    (folder / "toy.py").write_text(module, encoding="utf-8")
    return file


def widths(data):
    """An axis that follows from the first sweep."""
    return [{"tracker.sigma_f": [0.1, 0.1 + len(data.sweeps["first"].runs)]}]


def columns(name, runs, results):
    """The runs with the number of points of their scans."""
    return with_columns(runs, points_of_scans=[len(r.load("scans").points_world) for r in results])


def material(data):
    """A table and a file of the data, which is kept in `SEEN`."""
    SEEN.append(data)
    runs = data.sweeps["first"].runs
    table = pd.DataFrame([(run.setting["road_user"], run.metrics["iou_mean"]) for run in runs])
    table.columns = ["who", "a_b <i>"]
    return Material({"Own & only": table}, {"extra/note.txt": "kept\n"})
