"""A small study made for the tests: its file, and its report."""

import copy
from importlib.machinery import ModuleSpec
from types import ModuleType

from stixel_cli.report import style
from stixel_cli.studies.types import Figure, Findings, Paragraph, Picture, Section, Table

FEW = {"measurement": "fabricated", "path.duration": 0.3, "executor": "threads"}
"""Three scans, computed without starting a process."""

TOY = {
    "title": "A <toy> & its title",
    "question": "What comes of it?",
    "report": "toy",
    "sweeps": {
        "first": {
            "fixed": FEW,
            "zipped": [{"road_user": ["car", "pedestrian"], "path": ["turn", "crossing"]}],
            "seeds": 2,
            "results": ["scans", "track"],
        },
        "second": {
            "fixed": FEW,
            "seeds": 1,
            "results": ["scans"],
            "derive": "widths",
        },
    },
}


def toy_module():
    """The module of its report, as if it were among the package's; `seen` holds what it saw."""
    module = ModuleType("stixel_cli.studies.toy.report")
    module.__spec__ = ModuleSpec(module.__name__, None)
    module.seen = []
    module.widths = lambda data: [
        {"tracker.sigma_f": [0.1, 0.1 + len(data.sweeps["first"].points)]}
    ]
    module.report = lambda data: report(data, module.seen)
    return module


def changed(where, value):
    """The file's content with one entry changed, or left out if `value` is None."""
    content = copy.deepcopy(TOY)
    *outer, last = where
    inner = content
    for name in outer:
        inner = inner[name]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return content


def report(data, seen):
    """A figure, a picture, tables and a file of the data, which is kept in `seen`."""
    seen.append(data)
    points = data.sweeps["first"].points
    with style.drawing():
        figure = style.new_figure(3.0, 2.0)
        figure.subplots().plot([p.metrics["iou_mean"] for p in points], color=style.RUNS[0])
        svg = style.svg(figure)
    rows = tuple((p.setting["road_user"], p.seed, p.metrics["iou_mean"], 0.25) for p in points)
    return Findings(
        (f"{len(points)} points <b>.",),
        (
            Section(
                "One & only",
                (
                    Paragraph("A <script> is text."),
                    Figure("one", "First.", svg),
                    Section("Inner", (Figure("two", "Second.", svg),)),
                    Picture("dot", "A picture.", b"\x89PNG", "image/png"),
                    Table("numbers", "50 % of a_b.", ("who", "seed", "IoU", "± IoU"), rows),
                    Table("gaps", "No value.", ("a", "b"), ((None, 1.5), ("x|y", None))),
                ),
            ),
        ),
        {"extra/note.txt": "kept\n"},
        (Table("answer", "In short.", ("who", "seed"), (("car", 7),)),),
    )
