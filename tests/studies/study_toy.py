"""A small study made for the tests: its file, and its report."""

import copy
from importlib import resources

import yaml

from stixel_cli import studies
from stixel_cli.pictures import style
from stixel_cli.report.blocks import Figure, Material, Picture, Table
from stixel_cli.report.template import findings_of, template_of

FEW = {"measurement": "fabricated", "path.duration": 0.3, "executor": "threads"}
"""Three scans, computed without starting a process."""

TOY = {
    "title": "A <toy> & its title",
    "question": "What comes of it?",
    "template": "toy.md.j2",
    "module": "toy.py",
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


SEEN = []
"""The data that the report was made from."""


def write(folder, content=TOY, name="toy"):
    """The study's file, with template and module next to it."""
    file = folder / f"{name}.yaml"
    text = content if isinstance(content, str) else yaml.safe_dump(content, sort_keys=False)
    file.write_text(text, encoding="utf-8")
    (folder / "toy.md.j2").write_text(TEMPLATE, encoding="utf-8")
    module = "from study_toy import report, widths\n"
    (folder / "toy.py").write_text(module, encoding="utf-8")
    return file


TEMPLATE = """{{ runs | length }} runs <b>.

{{ show(answer) }}

# One & only

A <script>
is text.

{% call show(one) %}First.{% endcall %}

## Inner

{{ show(two) }}

# Tables

{{ show(dot) }}
{{ show(numbers) }}
{{ show(gaps) }}
"""


def widths(data):
    """An axis that follows from the first sweep."""
    return [{"tracker.sigma_f": [0.1, 0.1 + len(data.sweeps["first"].runs)]}]


def report(data):
    """A figure, a picture, tables and a file of the data, which is kept in `SEEN`."""
    SEEN.append(data)
    runs = data.sweeps["first"].runs
    with style.drawing():
        figure = style.new_figure(3.0, 2.0)
        figure.subplots().plot([p.metrics["iou_mean"] for p in runs], color=style.RUNS[0])
        svg = style.svg(figure)
    rows = tuple((p.setting["road_user"], p.seed, p.metrics["iou_mean"], 0.25) for p in runs)
    columns = ("who", "seed", "IoU", "± IoU")
    values = {
        "runs": runs,
        "one": Figure("one", "", svg),
        "two": Figure("two", "Second.", svg),
        "dot": Picture("dot", "A picture.", b"\x89PNG", "image/png"),
        "numbers": Table("numbers", "50 % of a_b.", columns, rows),
        "gaps": Table("gaps", "No value.", ("a", "b"), ((None, 1.5), ("x|y", None))),
        "answer": Table("answer", "In short.", ("who", "seed"), (("car", 7),)),
    }
    return Material(values, {"extra/note.txt": "kept\n"})


def answer_of(study, values):
    """The paragraphs of a shipped study's answer: its template before the first heading."""
    text = (resources.files(studies) / f"templates/{study}.md.j2").read_text("utf-8")
    values = {"answer_table": Table("t", "", (), ()), **values}
    template = template_of(text.partition("\n# ")[0], study)
    return findings_of(template, Material(values), study).answer
