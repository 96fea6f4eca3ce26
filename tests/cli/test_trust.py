"""Files and presets that name code: refused without --trust-code, and no dry run imports it."""

import shutil
import sys

import pytest
import yaml

from stixel_cli.cli.app import main
from stixel_cli.config.folders import STUDIES, shipped_folder, use_presets
from stixel_cli.studies.file import read_study
from stixel_cli.sweeps.design import find_file, is_study

FEW = {"measurement": "fabricated", "path.duration": 0.3}
PLANNING = [["explain"], ["sweep", "--dry-run"]]


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
def test_a_trusted_file_is_imported_where_its_keys_are_asked(command, evil, tmp_path, capsys):
    file = sweep_file(evil, tracker="evil:track", code_folders=[str(evil)])
    assert main([*command, "--from", str(file), "--trust-code"]) == 0, capsys.readouterr().err
    # Keys have the default values of the parameters, which only the module knows.
    assert (tmp_path / "ran").exists()


def study_file(folder, module, **fixed):
    """A study of two sweeps."""
    content = {"title": "t", "question": "q", "text": "t", "module": module}
    sweeps = {name: {"fixed": FEW | fixed, "seeds": 1} for name in ("first", "second")}
    file = folder / "theirs.yaml"
    file.write_text(yaml.safe_dump(content | {"sweeps": sweeps}))
    return file


@pytest.mark.parametrize(
    ("module", "named"),
    [
        ("stixel_cli.evil.py", "stixel_cli.evil.py:columns"),
        ("./evil.py", "evil.py:columns"),
        ("evil", "evil:columns"),
        ("stixel_cli.engine.entries", "stixel_cli.engine.entries:columns"),
        # It is shipped, and not for a study of others.
        ("stixel_cli.studies.rq1", "stixel_cli.studies.rq1:columns"),
        ("", "tracker=evil:track"),
    ],
)
def test_a_study_of_others_runs_no_code(module, named, evil, tmp_path, capsys):
    (evil / "stixel_cli.evil.py").write_text((evil / "evil.py").read_text())
    file = study_file(evil, module, **({} if module else {"tracker": "evil:track"}))
    sys.path.append(str(evil))
    try:
        for more in (["--dry-run"], []):
            assert named in refused(capsys, "study", file, *more)
    finally:
        sys.path.remove(str(evil))
    assert not (tmp_path / "ran").exists() and not (tmp_path / "results").exists()


@pytest.fixture
def in_pipelines(monkeypatch, evil, tmp_path):
    """The folder of shipped studies of a checkout into which somebody put files."""
    shipped = shipped_folder("pipelines") / "studies"
    folder = tmp_path / "checkout" / "pipelines"
    shutil.copytree(shipped, folder / "studies")

    def found(name):
        return folder if name == "pipelines" else shipped_folder(name)

    for module in ("studies.file", "sweeps.design"):
        monkeypatch.setattr(f"stixel_cli.{module}.shipped_folder", found)
    return folder / "studies"


@pytest.mark.parametrize("module", ["stixel_cli.evil", "stixel_cli.studies.rq33"])
def test_a_file_among_the_shipped_ones_is_not_shipped(module, in_pipelines, evil, tmp_path, capsys):
    file, named = study_file(in_pipelines, module), f"{module}:columns"
    for study in (file, file.stem):
        assert named in refused(capsys, "study", study, "--dry-run")
    # Its functions are not shipped for a file elsewhere, either.
    assert named in refused(capsys, "study", study_file(evil, module), "--dry-run")
    sweep_file(in_pipelines, tracker="evil:track").rename(in_pipelines / "sweep.yaml")
    assert "tracker=evil:track" in refused(capsys, "sweep", "--from", "sweep")
    assert not (tmp_path / "ran").exists()


def test_the_list_of_shipped_studies_is_that_of_the_checkout():
    files = sorted((shipped_folder("pipelines") / "studies").glob("*.yaml"))
    assert [file.stem for file in files if is_study(file)] == [*STUDIES]
    for name in STUDIES:
        assert read_study(find_file(name, study=True)).is_shipped


def test_trusted_code_of_a_study_is_told_and_runs_once(evil, tmp_path, capsys):
    file = study_file(evil, "stixel_cli.evil.py")
    code = (evil / "evil.py").read_text() + "def material(data): ...\n"
    (evil / "stixel_cli.evil.py").write_text(code)
    assert main(["study", str(file), "--dry-run", "--trust-code"]) == 0
    module = "stixel_cli.evil.py"
    told = f"stixel: {file}: may run {module}:columns, {module}:material (--trust-code)\n"
    assert capsys.readouterr().err == told and (tmp_path / "ran").exists()
    # The next command trusts nobody.
    (tmp_path / "ran").unlink()
    assert "evil" in refused(capsys, "study", file, "--dry-run")
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("preset", "content", "typed"),
    [
        ("cache/shared", "folder: CACHE\nmax_size: 1GB\n", ["cache=shared"]),
        ("cache/shared", "folder: CACHE\nmax_size: 20GB\n", ["cache=shared", "cache.max_size=1GB"]),
        ("executor/fast", "kind: dask\naddress: tcp://127.0.0.1:9\n", ["executor=fast"]),
        ("tracker/p", "kind: own\nfunction: evil:track\n", ["tracker=p"]),
        ("experiment/e", "# @package _global_\nmetrics: ['evil:track']\n", ["experiment=e"]),
        ("experiment/e", "# @package _global_\ncode_folders: [theirs]\n", ["experiment=e"]),
        ("experiment/e", "# @package _global_\ncache: {folder: CACHE}\n", ["cache.max_size=1GB"]),
    ],
)
@pytest.mark.parametrize(
    "command", [*PLANNING, ["sweep"], ["run"], ["run", "--dry-run"], ["tune"]], ids=" ".join
)
def test_an_option_does_not_vouch_for_what_its_preset_names(
    command, preset, content, typed, evil, tmp_path, capsys
):
    file = evil / "conf" / f"{preset}.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(content.replace("CACHE", str(evil / "kept")))
    (tmp_path / "evil.py").write_text((evil / "evil.py").read_text())
    if preset == "experiment/e" and typed != ["experiment=e"]:
        typed = [*typed, "experiment=e"]
    if command == ["tune"]:
        if "experiment=e" in typed:
            return  # A tuning takes no experiment.
        typed = [*typed, "path.duration=interval(0.3,0.4)"]
    if "sweep" in command:
        typed = [*typed, "seed=0,1"]
    words = [*command, "measurement=fabricated", *typed, "--config-dir", evil / "conf"]
    assert str(evil / "conf") in refused(capsys, *words)
    assert not (tmp_path / "ran").exists() and not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("preset", "content", "named"),
    [
        ("cache/shared", "folder: CACHE\nmax_size: 1GB\n", "cache.folder=CACHE"),
        ("experiment/e", "# @package _global_\nmetrics: ['evil:track']\n", "metrics[0]=evil:track"),
    ],
)
def test_a_trusted_preset_is_told_once_and_used(preset, content, named, evil, tmp_path, capsys):
    file = evil / "conf" / f"{preset}.yaml"
    file.parent.mkdir(parents=True)
    kept = str(tmp_path / "kept")
    file.write_text(content.replace("CACHE", kept))
    (tmp_path / "evil.py").write_text((evil / "evil.py").read_text())
    words = ["run", "--dry-run", "measurement=fabricated", "path.duration=0.3", "seed=0"]
    words += [preset.replace("/", "="), "--config-dir", str(evil / "conf"), "--trust-code"]
    assert main(words) == 0, capsys.readouterr().err
    told = f"stixel: {evil / 'conf'}: may run {named.replace('CACHE', kept)} (--trust-code)\n"
    assert capsys.readouterr().err == told
    assert (tmp_path / "ran").exists() == ("evil" in named)
    # The next command trusts nobody.
    assert str(evil / "conf") in refused(capsys, *words[:-1])


def test_the_very_key_typed_replaces_what_a_preset_names(evil, tmp_path, capsys):
    file = evil / "conf" / "cache" / "shared.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(f"folder: {evil / 'kept'}\nmax_size: 1GB\n")
    words = ["run", "--dry-run", "measurement=fabricated", "path.duration=0.3", "cache=shared"]
    words += [f"cache.folder={tmp_path / 'mine'}", "--config-dir", str(evil / "conf")]
    assert main(words) == 0, capsys.readouterr().err


TUNING = {"objectives": ["iou_mean"], "over": ["seed"], "seeds": 1, "trials": 1}


def tuning(evil, words, **entries):
    folder = evil / "tuning"
    folder.mkdir(exist_ok=True)
    swept = ["measurement=fabricated", "path.duration=0.3", "start.velocity=1,2"]
    content = TUNING | {"overrides": [*swept, *words]} | entries
    (folder / "tune.yaml").write_text(yaml.safe_dump(content))
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ["tracker=evil:track"],
        ["tracker=evil:track,point"],
        ["metrics=[evil:track]"],
        ["code_folders=[theirs]"],
    ],
)
def test_a_foreign_tuning_is_refused(words, evil, tmp_path, capsys):
    (tmp_path / "evil.py").write_text((evil / "evil.py").read_text())
    folder = tuning(evil, words)
    assert str(folder) in refused(capsys, "tune", "--resume", folder)
    assert [path.name for path in folder.iterdir()] == ["tune.yaml"]
    assert not (tmp_path / "ran").exists()
    if words[0] == "tracker=evil:track":
        # It fails: the function gives no track.
        assert main(["tune", "--resume", str(folder), "executor=threads", "--trust-code"]) == 2
        assert capsys.readouterr().err.startswith(f"stixel: {folder}: may run tracker=evil:track")
        assert (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("entries", "named"),
    [
        ({"trials": -5}, "trials"),
        ({"seeds": 99_999_999}, "seeds"),
        ({"seeds": True}, "seeds"),
        ({"objectives": [3]}, "objectives"),
        ({"more": 1}, "more"),
        ({"overrides": ["tracker.none=interval(0,1)"]}, "tracker.none"),
    ],
)
def test_a_wrong_request_of_a_tuning_is_refused(entries, named, evil, capsys):
    folder = tuning(evil, [], **entries)
    assert main(["tune", "--resume", str(folder)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert named in line and "internal error" not in line


def test_a_resumed_tuning_takes_neither_cache_nor_scheduler_of_the_folder(evil, tmp_path, capsys):
    words = [f"cache.folder={evil / 'kept'}", "executor=dask", "executor.address=tcp://127.0.0.1:9"]
    folder = tuning(evil, words)
    assert main(["tune", "--resume", str(folder), "executor=threads"]) == 0, capsys.readouterr().err
    assert not (evil / "kept").exists() and (folder / "index.html").exists()
    assert main(["tune", "--resume", str(folder), "seed=1"]) == 2


def test_a_sweep_writes_no_run_through_a_link(evil, tmp_path, capsys):
    words = ["measurement=fabricated", "path.duration=0.3", "executor=threads", "seed=0,1"]
    assert main(["sweep", *words, "--results", str(evil), "--name", "s"]) == 0
    (tmp_path / "victim" / "0000").mkdir(parents=True)
    (tmp_path / "victim" / "0000" / "kept").touch()
    shutil.rmtree(evil / "s" / "runs")
    (evil / "s" / "runs").symlink_to(tmp_path / "victim")
    capsys.readouterr()
    assert main(["sweep", "--resume", str(evil / "s"), "executor=threads"]) == 2
    assert "not a path below the folder" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "victim").rglob("*")] == ["0000", "kept"]
