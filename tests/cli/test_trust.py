"""Files and presets that name code: refused without --trust-code, and no dry run imports it."""

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.config.folders import use_presets
from stixel_cli.errors import UserError
from stixel_cli.report.blocks import Material
from stixel_cli.report.template import findings_of, template_of

FEW = {"measurement": "fabricated", "path.duration": 0.3}
PLANNING = [["plan"], ["explain"], ["sweep", "--dry-run"]]


@pytest.fixture
def evil(tmp_path, monkeypatch):
    """A folder with a module that leaves the file `ran` when it is imported."""
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "own cache"))
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "theirs"
    folder.mkdir()
    code = f"open({str(tmp_path / 'ran')!r}, 'w').close()\n"
    (folder / "evil.py").write_text(code + "def track(scans, initial, prior): ...\n")
    yield folder
    use_presets(None)


def refused(capsys, *words):
    assert main(list(map(str, words))) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--trust-code" in line
    return line


def sweep_file(folder, **fixed):
    file = folder / "theirs.yaml"
    file.write_text(yaml.safe_dump({"fixed": FEW | fixed, "axes": {"seed": [0, 1]}}))
    return file


@pytest.mark.parametrize(
    "named",
    [
        {"tracker": "evil:track"},
        {"metrics": ["evil:track"]},
        {"cache.folder": "/tmp/theirs"},
        {"executor": "dask", "executor.address": "tcp://127.0.0.1:9"},
    ],
)
@pytest.mark.parametrize("command", [*PLANNING, ["sweep"]])
def test_a_file_that_names_code_is_refused(command, named, evil, tmp_path, capsys):
    file = sweep_file(evil, **named, code_folders=[str(evil)])
    line = refused(capsys, *command, "--from", file)
    assert str(file) in line
    assert str(list(named.values())[-1]).strip("[]'") in line
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("command", PLANNING)
def test_a_dry_run_never_imports(command, evil, tmp_path, capsys):
    file = sweep_file(evil, tracker="evil:track", code_folders=[str(evil)])
    assert main([*command, "--from", str(file), "--trust-code"]) == 0, capsys.readouterr().err
    # The other two compare keys, which have the default values of the parameters.
    assert (tmp_path / "ran").exists() == ("--dry-run" not in command)


@pytest.mark.parametrize("command", [*PLANNING, ["sweep"], ["run"], ["run", "--dry-run"]])
@pytest.mark.parametrize("named", ["metrics: ['evil:track']", "cache: {folder: /tmp/theirs}"])
def test_presets_that_name_code_are_refused(command, named, evil, tmp_path, capsys):
    preset = evil / "experiment" / "theirs.yaml"
    preset.parent.mkdir()
    text = f"# @package _global_\ncode_folders: ['{evil}']\n{named}\n"
    preset.write_text(text)
    words = [*command, "experiment=theirs", "measurement=fabricated", "path.duration=0.3"]
    words += [] if command == ["run"] else ["seed=0,1"] if command[0] == "sweep" else []
    assert str(evil) in refused(capsys, *words, "--config-dir", evil)
    assert not (tmp_path / "ran").exists()
    if "--dry-run" in command and command[0] == "sweep" and "metrics" in named:
        assert main([*words, "--config-dir", str(evil), "--trust-code"]) == 0
        assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("module", ["evil.py", "stixel_cli.studies.rq1.report"])
def test_a_study_outside_of_the_package_is_refused(module, evil, tmp_path, capsys):
    entries = {"title": "t", "question": "q", "template": "rq1.md.j2", "module": module}
    fixed = FEW | {"tracker": "evil:track"}
    content = entries | {"sweeps": {"first": {"fixed": fixed, "seeds": 1}}}
    file = evil / "mine.yaml"
    file.write_text(yaml.safe_dump(content))
    named = "evil.py" if module == "evil.py" else "tracker=evil:track"
    assert named in refused(capsys, "study", file, "--dry-run")
    assert not (tmp_path / "ran").exists()


def test_a_template_outside_of_the_package_runs_in_a_sandbox():
    text = "{{ ''.__class__.__base__.__subclasses__() }}"
    with pytest.raises(UserError, match=r"template: mine: .*SecurityError.*unsafe"):
        findings_of(template_of(text, "mine"), Material({}, {}), "mine")
