"""Wrong input of a study: one line on stderr, exit code 2, and no new folder."""

import re

import pytest
from study_toy import changed

MODULE = """from study_toy import columns, widths
from stixel_cli.studies.report import Material, rows_of


def {name}:
    {body}
"""

TINY = ("road_user=car", "seed=0")


@pytest.mark.parametrize(
    ("name", "body", "error"),
    [
        ("material(data)", "return data.sweeps['third']", "toy.py, line 6: `return data.sweeps"),
        ("material(data)", "return 3", "material: must return Material, got 3"),
        ("columns(name, runs, results)", "return 1 / 0", r"toy.py, line 6: `return 1 / 0`\)"),
        ("columns(name, runs, results)", "return runs.frame", "columns: must return Runs, got "),
        (
            "columns(name, runs, results)",
            "return rows_of(runs, [[{'iou_mean': 1.0}] * 2] * len(runs), ())",
            "questions: trackers: points_of_scans: no such column",
        ),
        ("widths(data)", "return data['first']", r"widths: .*toy\.py, line 6: "),
        ("widths(data)", "return [{'seed': 3}]", "widths must return a list of mappings"),
    ],
)
def test_a_failing_module_names_its_file_and_line(studies, toy, tmp_path, name, body, error):
    file = toy()
    (tmp_path / "toy.py").write_text(MODULE.format(name=name, body=body), encoding="utf-8")
    assert studies.run(file, *TINY, code=2) is None
    assert re.search(error, studies.messages[-1])


def test_a_missing_scheduler_is_refused_in_one_line_before_the_notes(
    studies, toy, own_cache, monkeypatch
):
    monkeypatch.setattr("stixel_cli.engine.dask_pool.PATIENCE", 0.5)
    left_out = ("path=s_curve", "seed=0")
    nobody = ("executor=dask", "executor.address=tcp://127.0.0.1:9")
    file = toy()
    assert studies.run(file, *left_out, "--dry-run")["notes"]
    assert "127.0.0.1:9" in studies.refused(file, *left_out, *nobody)
    assert not studies.results.exists()


def test_a_long_path_is_shortened_in_a_message(studies, toy, tmp_path):
    file = toy()
    folder = tmp_path.joinpath(*5 * ["x" * 100])
    folder.mkdir(parents=True)
    file = file.rename(folder / file.name)
    error = studies.refused(file)
    assert "module: no file toy.py in" in error and len(error) < 700


@pytest.mark.parametrize(
    ("entries", "value", "error"),
    [
        (("title",), None, "title: is missing"),
        (("question",), 3, "question: must be a valid string"),
        (("module",), "none_such", "module: no module none_such"),
        (("module",), "none_such.py", "module: no file none_such.py in"),
        (("text",), None, "text: is missing"),
        (("template",), "x", "template: is unknown"),
        (("text",), "IoU of {traker}.", "text: {traker}: is no question"),
        (("questions",), [], "questions: must be an object"),
        (("questions", "a b"), {}, "questions: a b: name: "),
        (("questions", "x" * 61), {}, "x…: name: "),
        (("questions", "trackers"), "first", "questions: trackers: must have entries"),
        (("questions", "trackers", "metric"), "x", "trackers: metric: is unknown; did you mean"),
        (("questions", "trackers", "sweeps"), "third", "sweeps: there is no sweep third"),
        (("questions", "trackers", "where"), "x", "where: must be"),
        (("questions", "trackers", "by"), 3, "by: must be a"),
        (("questions", "trackers", "better"), "big", "better: must be "),
        (("sweeps",), [], "sweeps: must be"),
        (("tittle",), "x", "tittle: is unknown; did you mean title?"),
        (("sweeps", "first", "result"), [], "first: result: is unknown; did you mean results?"),
        (("sweeps", "first", "results"), ["scns"], "has a step scns; did you mean scans?"),
        (("sweeps", "second", "derive"), "width", "has no function width"),
        (("sweeps", "first", "derive"), "widths", "derive: no earlier sweep"),
        (("sweeps", "first", "fixed"), {"path.durations": 1}, "did you mean path.duration?"),
        (("sweeps", "second", "seeds"), 0, "sweeps: second: seeds: must be"),
        (("sweeps", "a b"), {}, "sweeps: a b: name: "),
        (("questions", "q"), {"sweeps": None, "by": None, "compare": 3}, "compare: must be"),
        (("sweeps", "x" * 61), {}, "x…: name: "),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(studies, toy, entries, value, error):
    file = toy(changed(entries, value))
    assert error in studies.refused(file)


def test_no_study_no_override_of_any_sweep_and_no_name_are_refused(studies, toy):
    assert "toy.yaml: line 2" in studies.refused(toy("title: [\n"))
    assert "is a sweep, not a study" in studies.refused(toy("axes:\n  seed: [0, 1]\n"))
    file = toy()
    assert "unknown key" in studies.refused(file, "tracker.sigma=1")
    assert "must be > 0" in studies.refused(file, "path.duration=-1")
    assert "rq2" in studies.refused() and "all" in studies.error
    assert "name a study first" in studies.refused("road_user=car")
    assert "rq3: one command runs one study, or all" in studies.refused("rq2", "rq3")
    assert "did you mean" in studies.refused("rq22")
    said = studies.refused("prior_width")
    assert "stixel sweep --from " in said and "prior_width.yaml" in said
    assert "leave it out with all" in studies.refused("all", "--name", "x")


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("import no_such_module\n", "toy.py, line 1: "),
        ("def material(data): ...\n", "toy.py has no function widths"),
        ("def report(:\n", "SyntaxError: invalid syntax (toy.py, line 1)"),
    ],
)
def test_a_wrong_module_is_refused(studies, toy, tmp_path, content, error):
    file = toy()
    (tmp_path / "toy.py").write_text(content, encoding="utf-8")
    assert error in studies.refused(file)


@pytest.mark.parametrize(
    ("entry", "value", "error"),
    [
        ("compare", "traker", "questions: trackers: traker: no such column"),
        ("where", {"traker": "point"}, "questions: trackers: traker: no such column"),
        ("by", "road", "questions: trackers: road: no such column"),
        ("metrics", ["iou_men"], "questions: trackers: iou_men: no such column"),
    ],
)
def test_a_question_about_no_column_is_refused(studies, toy, entry, value, error):
    file = toy(changed(("questions", "trackers", entry), value))
    assert studies.run(file, *TINY, code=2) is None
    assert error in studies.messages[-1]
