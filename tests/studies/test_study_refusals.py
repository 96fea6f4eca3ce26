"""Wrong input of a study: one line on stderr, exit code 2, and no new folder."""

import pytest

REPORT = """from stixel_cli.studies.types import Material, Section, Table
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
            "'../x' is not a valid file name",
        ),
    ],
)
def test_a_failing_report_names_its_file_and_line(studies, own_report, body, error):
    file = own_report(body)
    assert studies.run(file, *TINY, code=2) is None
    assert error in studies.error and studies.error.count("\n") == 1
    assert "internal error" not in studies.error


def test_a_failing_derive_names_its_file_and_line(studies, toy, tmp_path):
    file = toy()
    module = tmp_path / "toy.py"
    for body, error in (
        ("data['first']", "widths: "),
        ("[{'seed': 3}]", "widths must return a list of mappings"),
    ):
        text = f"from study_toy import report\n\n\ndef widths(data):\n    return {body}\n"
        module.write_text(text, encoding="utf-8")
        studies.run(file, *TINY, code=2)
        assert error in studies.error and studies.error.count("\n") == 1
    module.write_text(text.replace("[{'seed': 3}]", "data['first']"), encoding="utf-8")
    studies.run(file, *TINY, code=2)
    assert "toy.py: line 5: TypeError" in studies.error


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
