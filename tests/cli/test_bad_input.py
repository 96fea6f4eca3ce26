"""Bad command lines, most of them made from the schema: one line, exit code 2, nothing written."""

import subprocess
import sys
from typing import Any

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import describe, known_keys

SENTENCES = {
    "rig.widht=3": "rig.widht: there is no such key; did you mean rig.width?",
    "+rig.widht=3": "rig.widht: there is no such key; did you mean rig.width?",
    "++rig.widht=3": "rig.widht: there is no such key; did you mean rig.width?",
    "camera.baseline=1": "camera.baseline: there is no such key; did you mean rig.baseline?",
    "rig.fov=60": "rig.fov: there is no such key; did you mean rig.horizontal_fov?",
    "rig/width=3": "rig/width: there is no such key; did you mean rig.width?",
    "road_usr=car": "road_usr: there is no such key; did you mean road_user?",
    "road_user=cyclst": "did you mean road_user=cyclist? (options: car, cyclist, pedestrian)",
    "road_user=bike": "road_user: there is no option 'bike' (options: car, cyclist, pedestrian)",
    "road_user=null": "road_user: there is no option 'null' (options:",
    "road_user=[car]": 'road_user: ["car"]: one option is needed (options:',
    "rig={width: 3}": 'rig: {"width": 3}: one option is needed',
    "+x=3": "x: there is no such key; `stixel run --help`",
    "+rig.width=300": "+rig.width=300: rig.width is there already: leave out the +",
    "+rig=kitti": "+rig=kitti: rig is there already: leave out the +",
    "~rig.width": "~rig.width: nothing can be left out",
    "~path": "~path: nothing can be left out",
    "rig@x=kitti": "rig@x=kitti: no package (@) can be given; write rig=…",
    "path.kind=circle": "path.kind: follows from the option of path",
    "measurement.rays=9": "measurement.rays: there is no such key with measurement=simulated; it "
    "belongs to measurement=fabricated",
    "renderer.light=3": "renderer.light: holds several keys: give one of them",
    "rig.baseline=-0.3": "rig.baseline: -0.3 is out of range: must be > 0 and ≤ 5",
    "rig.width=3.5": "rig.width: 3.5 is a number with a point: must be a whole number ≥ 64",
    "rig.width=wide": "rig.width: 'wide' is text: must be a whole number ≥ 64 and ≤ 4096",
    "rig.width='640'": "rig.width: '640' is text",
    "rig.width=": "rig.width: '' is empty",
    "rig.width=true": "rig.width: true is a truth value",
    "rig.width=null": "rig.width: null is null",
    "rig.width=[1]": "rig.width: [1] is a list",
    "rig.baseline=nan": "rig.baseline: NaN is not finite",
    "rig.baseline=inf": "rig.baseline: Infinity is not finite",
    "seed=-1": "seed: -1 is out of range: must be ≥ 0",
    "stereo.disparities=100": "stereo.disparities: 100 does not fit: must be a whole number ≥ 16",
    "path.side=lft": "path.side: 'lft' is not known: must be one of left, right; did you mean left",
    "path.start=[1]": "path.start[1]: is missing",
    "path.start=[1,a]": "path.start[1]: 'a' is text",
    "pictures.frames=3": "pictures.frames: 3 is a whole number: must be a list",
    "seed=0,1": "seed: 0,1 stands for several values: one run needs one",
    "path=turn,circle": "path: turn,circle stands for several values",
    "rig.width=range(64,90)": "rig.width: range(64,90) stands for several values",
    "seed=choice(1,2)": "seed: choice(1,2) stands for several values",
    "path=glob(*)": "path: glob(*) stands for several values",
    "rig.width": "rig.width: a value is missing: write rig.width=VALUE",
    "road_user": "road_user: an option is missing: write road_user=car|cyclist|pedestrian",
    "kitti": "kitti: is an option: write rig=kitti",
    "default": "'default': must be KEY=VALUE",
    "rig.widht": "'rig.widht': must be KEY=VALUE; did you mean rig.width=…?",
    "=3": "=3: the key before the = is missing",
    "": "'': a KEY=VALUE is needed",
    " ": "' ': a KEY=VALUE is needed",
    "rig.width=[": "rig.width=[: [ and ] do not match",
    "rig.width={a:1": "rig.width={a:1: { and } do not match",
    "rig.width='a": "rig.width='a: the quote ' is not closed",
    "rig..width=3": "rig..width: there is no such key; did you mean rig.width?",
    "rig.width=${": "{ and } do not match",
    "rig.width=${nope}": "rig.width: there is no key nope to take the value of",
    "rig.width=${rig.widht}": "did you mean ${rig.width}?",
    "rig.width=${rig.width}": "rig.width: Recursive interpolation",
    "rig.width=${pace}": "rig.width: {",
    "rig.width=${nope:3}": "rig.width: Unsupported interpolation type nope",
    "rig.width=${oc.env:NO_SUCH_VARIABLE}": "NO_SUCH_VARIABLE",
    "rig.width=???": "rig.width: ??? stands for a missing value",
    "rig=???": "rig: there is no option '???'",
    "rig=${road_user}": "rig: there is no option '${road_user}'",
    "hydra.run.dir=x": "Hydra's own settings have no effect here",
    "hydra/launcher=x": "Hydra's own settings have no effect here",
    "+hydra.x=1": "Hydra's own settings have no effect here",
    "defaults=3": "defaults: there is no such key",
    "_self_=3": "_self_: there is no such key",
    "seed.x=3": "seed.x: there is no such key; did you mean seed?",
    "rig._target_=os.system": "rig._target_: there is no such key; rig has width, height",
    "seed=1\nrig.width=3": "seed=1\\nrig.width=3: cannot be read",
    "rig.width=\udcff": "is not UTF-8 text",
    "\x1b[31m=3": "\\x1b[31m",
    "rig.width=" + "9" * 5000: "rig.width=999",
    "rig.width=" + "[" * 3000: "[ and ] do not match",
    "x" * 5000 + "=1": "there is no such key",
}


def say_one_line(words, capsys):
    assert main(["run", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err.startswith("stixel: ")
    assert "Traceback" not in said.err
    assert len(said.err) < 450
    return said.err


@pytest.fixture(autouse=True)
def _nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STIXEL_CACHE", str(tmp_path / "cache"))
    yield
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", SENTENCES, ids=lambda text: ascii(text)[:40])
def test_one_line_says_it(text, capsys):
    assert SENTENCES[text] in say_one_line([text], capsys)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["seed=1", "seed=2"], "seed: is given twice, seed=1 and seed=2: give it once"),
        (["rig=kitti", "rig=default"], "rig: is given twice"),
        (["+seed=1", "seed=2"], "+seed=1: seed is there already"),
        (["seed", "=", "3"], "seed: a value is missing"),
        (["rig=kitti", "rig.horizontal_fov=60"], "rig.horizontal_fov and rig.focal_length"),
        (["rig.height=3", "rig.baseline=-1"], "(and 1 more fault)"),
        (["pace.speed=-3", "path=approach"], "pace.speed: -3 is out of range"),
    ],
)
def test_words_that_do_not_go_together(words, message, capsys):
    assert message in say_one_line(words, capsys)


@pytest.mark.parametrize("group", group_options())
def test_near_misses_of_options(group, capsys):
    for option in group_options()[group]:
        miss = option[:-1] if option[:-1] not in group_options()[group] else option + "x"
        if len(option) > 2:
            assert f"{group}={option}" in say_one_line([f"{group}={miss}"], capsys)


@pytest.mark.parametrize("name", list(known_keys())[::3])
def test_near_misses_of_keys(name, capsys):
    assert "there is no such key" in say_one_line([f"{name}q=1"], capsys)
    assert "give it once" in say_one_line([f"{name}=1", f"{name}=1"], capsys)


def wrong_value(key) -> Any:
    """A value of the wrong type, or far out of range, as it is typed."""
    words = describe(key.annotation)
    return "{a: 1}" if words.startswith("text") else "-1e9" if "number" in words else "xyzzy"


@pytest.mark.parametrize("name", list(known_keys())[::4])
def test_wrong_values(name, capsys):
    key = known_keys()[name][0]
    choice = [f"{name.partition('.')[0]}={key.kind}"] if key.kind else []
    said = say_one_line([*choice, f"{name}={wrong_value(key)}"], capsys)
    assert said.startswith(f"stixel: {name}")
    assert "must be" in said


@pytest.mark.parametrize(
    "words",
    [
        ["run", "rig.baseline=-0.3"],
        ["run", b"rig.width=\xff\xfe"],
        ["run", "road_user.mesh=\u00e9\u4e2d.obj"],
    ],
    ids=ascii,
)
def test_real_processes(words, tmp_path):
    program = "import sys; from stixel_cli.cli.app import main; sys.exit(main())"
    # An ASCII terminal must not make a crash of a message.
    environment = {"PATH": "/usr/bin:/bin", "PYTHONIOENCODING": "ascii", "HOME": str(tmp_path)}
    environment["PYTHONPATH"] = ":".join(sys.path)
    done = subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, env=environment, cwd=tmp_path
    )
    assert done.returncode == 2, done.stderr
    assert done.stdout == b""
    assert done.stderr.count(b"\n") == 1
    assert done.stderr.startswith(b"stixel: ")
