import functools
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer

from stixel_cli import __version__
from stixel_cli.cli.app import application, main
from stixel_cli.cli.terminal import REPLACED
from stixel_cli.config.folders import STUDIES
from stixel_cli.engine.errors import StageFailure
from stixel_cli.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
STIXEL = [sys.executable, "-m", "stixel_cli"]


@pytest.fixture
def stand_in(monkeypatch):
    """Replaces the body of `stixel run`."""

    def replace(body):
        (command,) = application("run").registered_commands
        stand_in = functools.wraps(command.callback)(lambda **given: body(*given.values()))
        monkeypatch.setattr(command, "callback", stand_in)
        typer.main.get_command.cache_clear()  # See `remembered.py`.

    yield replace
    typer.main.get_command.cache_clear()


def test_help_groups_every_command_and_names_every_study(capsys):
    assert main(["--help"]) == 0
    answer = capsys.readouterr().out
    assert main([]) == 0 and capsys.readouterr().out == answer
    _, start, shown = answer.partition("Run experiments:\n")
    assert len(re.findall(r"^\S.*:$", start + shown, flags=re.MULTILINE)) == 4
    named = re.findall(r"^  (\w+) +[A-Z]", shown, flags=re.MULTILINE)
    assert sorted(named) == sorted(COMMANDS) and len(named) <= 16
    assert main(["study", "--help"]) == 0
    said = capsys.readouterr().out
    named = re.findall(r"^ {4}(\w+) +[A-Z]", said, flags=re.MULTILINE)
    assert named == [*sorted(STUDIES), "all"]
    assert "the study's name, then the overrides" in " ".join(said.split())
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"stixel {__version__}\n"


@pytest.mark.parametrize("word", REPLACED)
@pytest.mark.parametrize("more", [[], ["--help"], ["results/a", "--odd"]])
def test_an_old_command_names_the_new_one(word, more, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([word, *more]) == 2
    said = capsys.readouterr()
    assert said.err == f"stixel: {word} is gone: use stixel {REPLACED[word]}\n" and not said.out
    command, *options = REPLACED[word].replace(",", " ").split()
    params = [name for one in COMMANDS[command].params for name in one.opts]
    known = {*params, *getattr(COMMANDS[command], "commands", ())}
    assert {one for one in options if one.startswith("-") or one == "class"} <= known
    assert not list(tmp_path.iterdir())


COMMANDS = typer.main.get_command(application("")).commands


@pytest.mark.parametrize(
    "command",
    [
        *COMMANDS,
        *(f"{group} {name}" for group in ("cache", "new") for name in COMMANDS[group].commands),
    ],
)
def test_every_command_has_a_help(command, capsys):
    assert main([*command.split(), "--help"]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"Usage: stixel {command} ")
    assert max(map(len, said.splitlines())) <= 100


@pytest.mark.parametrize(
    ("program", "heavy"),
    [
        (
            "from stixel_cli.cli.app import main; main(['--help'])",
            "numpy hydra omegaconf pydantic rich yaml scipy cv2 numba matplotlib open3d",
        ),
        (
            "from stixel_cli.config.compose import compose; compose(['seed=1'])",
            "scipy cv2 numba matplotlib open3d shapely joblib",
        ),
        (
            "from stixel_cli.border.origins import TYPED\n"
            "from stixel_cli.config.overrides import *\n"
            "check_overrides(read_overrides(['seed=3', 'path=turn'], TYPED))",
            "hydra antlr4",
        ),
        (
            "from stixel_cli import trackers; trackers.Contour(start=[0, 10, 0])",
            "hydra stixel_cli.engine",
        ),
    ],
)
def test_what_needs_little_imports_nothing_heavy(program, heavy):
    check = f"sys.exit([name for name in {heavy.split()} if name in sys.modules] or 0)"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; {program}; {check}"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_known_errors_and_ctrl_c_are_one_line_and_a_crash_without_a_log_is_shown(
    stand_in, capsys, monkeypatch
):
    stand_in(lambda *arguments: 3)
    assert main(["run"]) == 3
    stand_in(raising(UserError("rig.file: cannot\nbe read")))
    assert main(["run"]) == 2
    assert capsys.readouterr().err == "stixel: rig.file: cannot be read\n"
    stand_in(raising(KeyboardInterrupt))
    assert main(["run"]) == 130
    assert capsys.readouterr().err.count("\n") == 1
    stand_in(raising(ZeroDivisionError))
    monkeypatch.setattr("platformdirs.user_log_path", raising(OSError("disk full")))
    assert main(["run"]) == 1
    said = capsys.readouterr().err
    assert "disk full" in said
    assert "Traceback" in said


def raising(error):
    """The body of a command that fails."""

    def body(*arguments, **options):
        raise error

    return body


@pytest.mark.parametrize("line", ["ls {}", "sweep --resume {}", "verify {}", "study {}"])
def test_a_path_that_no_disk_takes_is_one_line(line, capsys):
    assert main(line.format("x" * 300).split()) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.endswith("File name too long\n")


def test_a_crash_leaves_a_log(stand_in, capsys, tmp_path, monkeypatch):
    stand_in(raising(ZeroDivisionError("of\nall things")))
    monkeypatch.setattr("platformdirs.user_log_path", lambda *_, **__: tmp_path)
    assert main(["run"]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "ZeroDivisionError: of all things" in said
    (log,) = tmp_path.iterdir()
    assert str(log) in said
    assert "Traceback" in log.read_text()
    assert __version__ in log.read_text()


def test_a_stage_that_fails_is_shown_with_file_line_and_code(
    stand_in, capsys, tmp_path, monkeypatch
):
    text = (
        'Traceback (most recent call last):\n  File "/a/box.py", line 7, in track\n'
        "    gain = self.alphaa\n           ^^^^\n"
        f'  File "{json.__file__}", line 1, in loads\n    raise\nAttributeError: alphaa\n'
    )
    stand_in(raising(StageFailure("track", "track", AttributeError("alphaa"), text)))
    monkeypatch.setattr("platformdirs.user_log_path", lambda *_, **__: tmp_path)
    assert main(["run"]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "stage track failed: AttributeError: alphaa" in said
    assert "/a/box.py, line 7: `gain = self.alphaa`" in said
    assert "internal error" not in said
    (log,) = tmp_path.iterdir()
    assert text in log.read_text()


WAITS = """
import signal
from pathlib import Path


def track(scans, initial, prior):
    Path({!r}).touch()
    signal.pause()
"""


def test_sigterm_ends_a_run_in_one_line(tmp_path):
    """Workers are running by then; the tracker never ends, so that the run cannot be faster."""
    (tmp_path / "waits.py").write_text(WAITS.format(str(tmp_path / "runs")))
    own = ["tracker=waits:track", f"code_folders=[{tmp_path}]", "--trust-code"]
    small = ["measurement=fabricated", "path.duration=1"]
    with subprocess.Popen(
        [*STIXEL, "run", *small, *own, "--results", str(tmp_path / "results")],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"STIXEL_CACHE": str(tmp_path / "cache")},
    ) as process:
        while process.poll() is None and not (tmp_path / "runs").exists():
            time.sleep(0.02)
        process.terminate()
        out, err = process.communicate(timeout=600)
    assert process.returncode == 130
    lines = [line for line in err.splitlines() if not line.startswith("stixel: [")]
    assert lines == ["stixel: interrupted; what was computed is kept: repeat the command to resume"]
    assert out == ""
    assert not list((tmp_path / "results").glob("*/*"))


def test_reader_that_goes_away_is_no_crash():
    line = " ".join(f"'{part}'" for part in [*STIXEL, "run", "--help"])
    shell = f"{line} | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True)
    assert done.stderr == ""
    assert done.returncode in (0, 1)


def test_a_reader_that_ends_loses_no_run(tmp_path):
    words = ["run", "measurement=fabricated", "path.duration=0.3", "pictures.frames=[]"]
    line = " ".join(f"'{part}'" for part in [*STIXEL, *words, "--name", "piped"])
    cache = os.environ | {"STIXEL_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    shell = f"{line} | head -n 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, cwd=tmp_path, env=cache)
    assert done.returncode == 0 and done.stdout.count(b"\n") == 1
    assert (tmp_path / "results" / "piped" / "index.html").exists()


@pytest.mark.parametrize(
    ("line", "code", "said", "printed"),
    [
        ("{} cache ls >/dev/full", 1, "stixel: standard output: cannot be written: No space", ""),
        ("{} cache ls --json >/dev/full", 1, "standard output: cannot be written", ""),
        ("{} cache ls >&-", 0, "", ""),
        ("{} cache clear <&-", 2, "add --yes", ""),
        ("PYTHONIOENCODING=ascii {} cache ls", 0, "", r"cach\xe9: 0 results"),
        ("mkdir gone; cd gone; rmdir ../gone; {} run", 2, "directory no longer exists", ""),
    ],
)
def test_streams_and_folders_that_a_shell_takes_away(line, code, said, printed, tmp_path):
    if "/dev/full" in line and not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    command = " ".join(f"'{part}'" for part in STIXEL)
    done = subprocess.run(
        ["bash", "-c", line.format(command)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"STIXEL_CACHE": str(tmp_path / "caché"), "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert done.stderr.count("\n") == bool(said)
    assert printed in done.stdout
