"""Questions of a study's file, asked of frames made by hand, and the text of their answers."""

import json
import re
from itertools import product

import pandas as pd
import pytest

from stixel_cli.answers.render import INTERVAL
from stixel_cli.answers.runs import Runs
from stixel_cli.errors import UserError
from stixel_cli.studies.file import study_question
from stixel_cli.studies.report import (
    Material,
    Report,
    asked,
    files_of,
    joined,
    rows_of,
    with_columns,
)

IOU = {"contour": 0.9, "gp_ekf": 0.8, "point": 0.5}


def runs_of(users=("car",), paths=("turn",), seeds=6, trackers=tuple(IOU), lost=()):
    """Runs whose IoU depends on the tracker, and a little on path and seed; `lost` have failed."""
    rows = []
    for user, tracker, path, seed in product(users, trackers, paths, range(seeds)):
        done, base = (tracker, seed) not in lost, IOU[tracker] + 0.01 * paths.index(path)
        iou = base + 0.002 * (seed % 3) + 0.001 * len(tracker) * seed
        row = {"road_user": user, "tracker": tracker, "path": path, "seed": seed}
        row |= {"status": "done" if done else "failed"}
        row |= {"iou_box_mean": iou if done else None, "track_lost": 0.0}
        rows.append(row | {"centre_rmse_m": 1.0 - iou if done else None})
    return Runs(pd.DataFrame(rows), ("road_user", "tracker", "path", "seed"))


def section_of(entries, **frames):
    return asked(study_question("it", entries, tuple(frames)), frames)


def test_a_question_has_an_answer_for_each_group_and_metric():
    runs = runs_of(("car", "pedestrian"), ("turn", "crossing"))
    section = section_of({"by": "road_user", "metrics": ["iou_box_mean", "nis_mean"]}, runs=runs)
    labels = [label for label, _ in section.groups]
    assert labels == ["car", "pedestrian"] and [len(own) for _, own in section.groups] == [1, 1]
    (answer,) = section.groups[0][1]
    assert (answer.question.compare, answer.question.within) == (("tracker",), ("path",))
    assert (answer.units, answer.best, answer.shown) == (6, "contour", True)
    assert section.brief.startswith("car: contour 0.9")
    cells = section.cells
    assert cells.header[:3] == ("road user", "tracker", "runs") and len(cells.rows) == 6
    best = [row[:2] for row, marks in zip(cells.rows, cells.best, strict=True) if any(marks)]
    assert best == [("car", "contour"), ("pedestrian", "contour")]


@pytest.mark.parametrize(
    ("made", "said"),
    [
        ({}, "contour 0.9"),
        ({"seeds": 1}, "contour 0.900, gp_ekf 0.800 and point 0.500 (1 seed: too few to compare"),
        ({"seeds": 3}, "contour 0.909, gp_ekf 0.808 and point 0.507 (3 seeds: too few to compare"),
        ({"trackers": ("point",)}, "point 0.5"),
        ({"lost": {("point", 0), ("point", 1), ("point", 2)}}, "contour 0.9"),
        ({"lost": {("point", k) for k in range(6)}}, "contour 0.9"),
        ({"lost": {(name, k) for k in range(6) for name in IOU}}, "no run has a value"),
    ],
)
def test_few_runs_claim_nothing(made, said):
    section = section_of({"metrics": "iou_box_mean"}, runs=runs_of(**made))
    assert section.brief.startswith(said) and "nan" not in section.brief.lower()
    for _, (answer,) in section.groups:
        enough = answer.units >= 4
        assert enough != ("4 are needed" in section.brief)
        assert enough == ("[" in section.brief)
        assert enough or not re.search("best|next|differ", section.brief + answer.sentence)


def test_where_and_a_reference_choose_runs_and_differences():
    runs = runs_of(paths=("turn", "crossing"))
    question = {"where": {"path": "turn"}, "reference": "point", "metrics": "iou_box_mean"}
    section = section_of(question, runs=runs)
    ((label, (answer,)),) = section.groups
    assert label == "" and answer.runs["path"].unique().tolist() == ["turn"]
    assert "against point (0.5" in section.brief and "contour +0.4" in section.brief.lower()
    # Overrides may leave the reference out.
    without = section_of(question, runs=runs_of(trackers=("contour", "gp_ekf")))
    assert "against" not in without.brief and without.groups[0][1][0].question.reference is None
    assert section_of(question | {"where": {"path": "circle"}}, runs=runs).groups == ()


def test_sweeps_are_compared_and_an_axis_of_one_alone_is_none_of_the_others():
    given = runs_of()
    frame = given.frame.assign(noise="0.1", iou_box_mean=given.frame["iou_box_mean"] - 0.3)
    other = Runs(frame, (*given.axes, "noise"))
    question = {"compare": "sweep", "within": "tracker", "over": "seed", "metrics": "iou_box_mean"}
    section = section_of(question | {"reference": "first"}, first=given, second=other)
    assert section.brief.startswith("second −0.3")
    question |= {"by": "noise", "compare": "tracker", "within": []}
    by_noise = section_of(question, first=given, second=other)
    assert [label for label, _ in by_noise.groups] == ["0.1"]


def test_runs_that_a_question_takes_for_one_are_refused_by_its_name():
    with pytest.raises(UserError, match=r"questions: it: runs: two are contour 0: name"):
        section_of({"within": []}, runs=runs_of(paths=("turn", "crossing")))


def test_further_columns_and_rows_of_a_module():
    runs = with_columns(runs_of(), points=range(18), shape=["a", "b"] * 9)
    assert runs.axes[-1] == "shape" and "points" not in runs.axes and "points" in runs.metrics
    rows = rows_of(runs_of(), [[{"range": "near", "error": k}] for k in range(18)], ("range",))
    assert rows.axes == ("road_user", "tracker", "path", "seed", "range")
    assert rows.metrics == ["error"] and "iou_box_mean" not in rows.frame


def test_tables_of_other_columns_or_without_intervals_are_joined_by_their_headers():
    runs = runs_of(trackers=("point", "contour"))
    names = (["iou_box_mean", "centre_rmse_m"], ["centre_rmse_m"])
    one, two = (section_of({"metrics": some}, runs=runs).cells for some in names)
    cells = joined("road_user", [("car", one), ("bus", two)])
    assert cells.header[0] == "road user" and len({*map(len, cells.rows)}) == 1
    assert [row[-2] for row in cells.rows][2:] == ["–", "–"]
    assert joined("", [("", one)]) == one
    runs = [runs_of(seeds=seeds) for seeds in (2, 6)]
    few, many = (section_of({"metrics": "iou_box_mean"}, runs=some).cells for some in runs)
    cells = joined("road_user", [("car", few), ("bus", many)])
    assert len(cells.header) == 4 and cells.header[-1].endswith(INTERVAL)
    assert not any("–" in row for row in cells.rows)


def test_files_of_a_report():
    section = section_of({"by": "road_user", "metrics": "iou_box_mean"}, runs=runs_of(("a/b ü",)))
    table = pd.DataFrame({"a": [1.5], "b": ["x"]})
    material = Material({"Own: table": table}, {"own/x.yaml": "a: 1\n"})
    files = files_of(Report(("One.",), (section,), material))
    tables = [f"tables/it-a-b-.{kind}" for kind in ("csv", "md", "tex")] + ["tables/own-table.csv"]
    assert {*files} == {*tables, "figures/it-a-b-.svg", "report.json", "own/x.yaml"}
    content = json.loads(files["report.json"])
    assert content["answer"] == ["One."] and [*content["questions"]["it"]] == ["a/b ü"]
    assert content["questions"]["it"]["a/b ü"][0]["tracker"] == "contour"
    for wrong in ({"tables": {"x": 3}}, {"files": {"x": 3}}):
        with pytest.raises(TypeError, match="x: must be of type"):
            Material(**wrong)
