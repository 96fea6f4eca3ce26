"""Wrong input of a study: one line on stderr, exit code 2, and no new folder."""

import pytest
from study_toy import changed

REPORT = """from stixel_cli.report.blocks import Material, Section, Table
from study_toy import report as toy_report, widths


def report(data):
    {body}
"""


@pytest.fixture
def own_report(toy, tmp_path):
    """Writes a toy study whose function `report` has the given body on line 6 of `toy.py`."""

    def write(body):
        file = toy()
        (tmp_path / "toy.py").write_text(REPORT.format(body=body), encoding="utf-8")
        return file

    return write


TINY = ("road_user=car", "seed=0")


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ("return data.sweeps['third']", "toy.py: line 6: KeyError: 'third'"),
        ("return Material(1 / 0)", "toy.py: line 6: ZeroDivisionError"),
        ("return Table('t', '', ('a', 'b'), ((1,),))", "toy.py: line 6: ValueError: table t"),
        ("return 3", "toy.py: report must return a Material"),
        (
            "m = toy_report(data); return Material(m.values, {'../x': ''})",
            "'../x' is not a path below the folder",
        ),
    ],
)
def test_a_failing_report_names_its_file_and_line(studies, own_report, body, error):
    file = own_report(body)
    assert studies.run(file, *TINY, code=2) is None
    (line,) = studies.messages
    assert error in line


@pytest.mark.parametrize(
    ("value", "error"),
    [
        ("data['first']", "widths: "),
        ("data['first']", "toy.py: line 5: TypeError"),
        ("[{'seed': 3}]", "widths must return a list of mappings"),
    ],
)
def test_a_failing_derive_names_its_file_and_line(studies, toy, tmp_path, value, error):
    file = toy()
    text = f"from study_toy import report\n\n\ndef widths(data):\n    return {value}\n"
    (tmp_path / "toy.py").write_text(text, encoding="utf-8")
    studies.run(file, *TINY, code=2)
    assert error in studies.messages[-1]


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
    assert "template: no file toy.md.j2 in" in error and len(error) < 700


@pytest.mark.parametrize(
    ("entries", "value", "error"),
    [
        (("title",), None, "title: is required"),
        (("question",), 3, "question: is required and must be a string"),
        (("module",), "none_such", "module: no module none_such"),
        (("module",), "none_such.py", "module: no file none_such.py in"),
        (("template",), "../none.j2", "template: no file ../none.j2 in"),
        (("sweeps",), [], "sweeps: must be names"),
        (("tittle",), "x", "tittle: no such entry; did you mean title?"),
        (("sweeps", "first", "result"), [], "first: result: no such entry; did you mean results?"),
        (("sweeps", "first", "results"), ["scns"], "has a step scns; did you mean scans?"),
        (("sweeps", "second", "derive"), "width", "has no function width"),
        (("sweeps", "first", "derive"), "widths", "derive: no earlier sweep"),
        (("sweeps", "first", "fixed"), {"path.durations": 1}, "did you mean path.duration?"),
        (("sweeps", "second", "seeds"), 0, "sweeps: second: seeds: must be"),
        (("sweeps", "a b"), {}, "sweeps: a b: a name"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(studies, toy, entries, value, error):
    file = toy(changed(entries, value))
    assert error in studies.refused(file)


def test_invalid_yaml_and_a_plain_sweep_are_refused(studies, toy):
    assert "toy.yaml: line 2" in studies.refused(toy("title: [\n"))
    assert "is a sweep, not a study" in studies.refused(toy("axes:\n  seed: [0, 1]\n"))


def test_an_override_that_no_sweep_accepts_is_refused(studies, toy):
    file = toy()
    assert "unknown key" in studies.refused(file, "tracker.sigma=1")
    assert "must be > 0" in studies.refused(file, "path.duration=-1")


def test_a_wrong_study_name_is_refused(studies, toy):
    assert "rq2" in studies.refused() and "all" in studies.error
    assert "name a study first" in studies.refused("road_user=car")
    assert "rq3: one command runs one study, or all" in studies.refused("rq2", "rq3")
    assert "did you mean" in studies.refused("rq22")
    assert "stixel sweep --from prior_width" in studies.refused("prior_width")
    assert "leave it out with all" in studies.refused("all", "--name", "x")


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        ("toy.py", "import no_such_module\n", "toy.py: line 1: ModuleNotFoundError"),
        ("toy.py", "def widths(data):\n    return []\n", "toy.py has no function report"),
        ("toy.py", "def report(:\n", "toy.py: line 1: SyntaxError"),
        ("toy.md.j2", "Text.\n\n{% for %}\n", "template: toy.md.j2: line 3"),
    ],
)
def test_a_wrong_template_or_module_is_refused(studies, toy, tmp_path, name, content, error):
    file = toy()
    (tmp_path / name).write_text(content, encoding="utf-8")
    assert error in studies.refused(file)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("One.\n{{ no_such_value }}", "line 2: UndefinedError: 'no_such_value' is undefined"),
        ("{{ show(3) }}", "line 1: TypeError: show takes a table, a figure or a picture"),
        ("{{ '%d' | format('x') }}", "line 1: TypeError"),
    ],
)
def test_a_template_that_cannot_be_filled_is_refused(studies, toy, tmp_path, text, error):
    file = toy()
    (tmp_path / "toy.md.j2").write_text(f"{text}\n", encoding="utf-8")
    assert studies.run(file, *TINY, code=2) is None
    (line,) = studies.messages
    assert f"template: toy.md.j2: {error}" in line
