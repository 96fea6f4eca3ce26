"""Bad command lines, most of them made from the schema: one line, exit code 2, nothing written."""

import re
import subprocess
import sys
from itertools import pairwise
from typing import Any

import pytest

from stixel_cli.cli.app import main
from stixel_cli.config.annotations import describe
from stixel_cli.config.folders import group_options, options_of_kind, outer_options
from stixel_cli.config.keys import known_keys
from stixel_cli.config.messages import _OTHER_KEYS, _REPLACED

USERS = group_options()["road_user"]
SENTENCES = {
    "rig.widht=3": "rig.widht: unknown key; did you mean rig.width?",
    "+rig.widht=3": "rig.widht: unknown key; did you mean rig.width?",
    "source.left=a.png": "source.left: unknown key with source=rendered; it belongs to source=pair",
    "rig.fov=60": "did you mean rig.horizontal_fov or rig.vertical_fov?",
    "road_usr=car": "road_usr: unknown key; did you mean road_user?",
    "road_user=cyclst": f"did you mean road_user=cyclist? (options: {', '.join(USERS)})",
    "road_user=truck": "a mesh: road_user.mesh=FILE",
    "road_user=bike": f"road_user: unknown option 'bike' (options: {', '.join(USERS)})",
    "tracker=own": "for your own, give a function: tracker=MODULE:FUNCTION",
    "+x=3": "x: unknown key; `stixel describe`",
    "+rig.width=300": "+rig.width=300: no key can be added or removed: leave out the +",
    "rig@x=kitti": "rig@x=kitti: packages (@) and Hydra's settings have no effect",
    "path.kind=circle": "path.kind: unknown key; did you mean path=approach|circle|",
    "measurement.rays=9": "measurement.rays: unknown key with measurement=stixels; it "
    "belongs to measurement=fabricated",
    "measurement.noise=constant": "unknown key; did you mean measurement/noise=constant|",
    "measurement.noise=cnstant": "measurement.noise: unknown key; did you mean measurement/noise=",
    "measurement.noise": "must be KEY=VALUE; did you mean measurement/noise=constant|",
    "measurement.noise.kind=stereo": "unknown key; did you mean measurement/noise=constant|",
    "measurement/noise=constant": "measurement/noise: there is no such group with "
    "measurement=stixels; it belongs to measurement=fabricated",
    "measurement.noise.range_std=1": "measurement.noise.range_std: unknown "
    "key with measurement=stixels; it belongs to measurement=fabricated measurement/noise=const",
    "measurement.noise.range_deviation=1": "did you mean measurement.noise.range_std",
    "range_deviation=1": " or measurement.noise.range_std or ",
    "start.position_deviation=1": "did you mean start.position",
    "measurement.disparity_std=1": "did you mean measurement.noise.disparity_std?",
    "measurement/noise.range_std=1": "did you mean measurement.noise.range_std?",
    "measurement.scanner=3": "measurement.scanner: is a group of keys: give one of them",
    "path.side=lft": "path.side: 'lft' is not known: must be one of left, right; did you mean left",
    "rig.width": "'rig.width': must be KEY=VALUE; did you mean rig.width=VALUE?",
    "road_user": f"must be KEY=VALUE; did you mean road_user={'|'.join(USERS)}?",
    "car": "'car': must be KEY=VALUE; did you mean road_user=car?",
    "tracker:contour": "must be KEY=VALUE; did you mean tracker=contour?",
    "=3": "=3: the key before the = is missing",
    "": "'': a KEY=VALUE is needed",
    "rig.width=${": "cannot be read: brackets and quotes must match",
    "rig.width=${rig.widht}": "did you mean ${rig.width}?",
    "rig.width=${oc.deprecated:rig.height}": "cannot be looked up: write ${KEY}",
    "hydra.run.dir=x": "Hydra's settings have no effect here",
    "rig._recursive_=true": "rig._recursive_: unknown key; rig has width, height",
    "seed=1\nrig.width=3": "seed=1\\nrig.width=3: is several overrides in one text",
    "rig.width=\udcff": "is not UTF-8 text",
    "\x1b[31m=3": "\\x1b[31m",
    "rig.width=" + "9" * 5000: "rig.width=999",
    "pictures.frames=[" + "0," * 6000 + "0]": "more than 5000 values: use range(",
    "road_user.mesh=" + "x " * 60_000: "longer than 100000 characters",
    "rig.width=" + "[" * 3000: "cannot be read: brackets and quotes must match",
    "x" * 5000 + "=1": "unknown key",
}
WRONG = [
    "road_user=null", "road_user=[car]", "rig={width: 3}", "~rig.width", "~path",
    "rig.baseline=-0.3", "rig.width='640'", "rig.width=", "rig.width=true", "rig.width=null",
    "source=folder", "rig.width=[1]", "tracker.length_scale=1e-12", "rig.baseline=nan",
    "rig.baseline=inf", "stereo.nearest=0", "path.start=[1]",
    "path.start=[1,a]", "pictures.frames=3", "seed=0,1", "path=turn,circle",
    "rig.width=range(64,90)", "seed=choice(1,2)", "path=glob(*)", "~tracker", "rig.width=[",
    "rig.width={a:1", "rig.width='a", "rig.width=${rig.width}", "rig.width=${pace}",
    "rig.width=${nope:3}", "rig.width=${oc.env:NO_SUCH_VARIABLE}", "rig.width=???",
    "rig=???", "rig=${road_user}", "defaults=3", "_self_=3", "stereo.nearest=5e-324",
]  # fmt: skip
"""Values, options and texts that cannot be; what is said begins with the key."""


def say_one_line(words, capsys, command="run"):
    assert main([*command.split(), *words]) == 2
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


def test_a_name_of_an_earlier_version_is_answered_by_the_name_of_today(capsys):
    for name, today in _OTHER_KEYS.items():
        assert f"{name}: unknown key; it is called {today}" in say_one_line([f"{name}=1"], capsys)
    for (group, option), today in _REPLACED.items():
        assert f"{option} is gone: use {today}" in say_one_line([f"{group}={option}"], capsys)


@pytest.mark.parametrize("text", WRONG)
def test_one_line_begins_with_the_key(text, capsys):
    key = text.lstrip("~").partition("=")[0]
    assert re.match(rf"stixel: ~?{re.escape(key)}\b", say_one_line([text], capsys))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["seed=1", "seed=2"], "seed: is given twice, seed=1 and seed=2: give it once"),
        (["seed", "=", "3"], "'seed': must be KEY=VALUE; did you mean seed=VALUE?"),
        (["rig=kitti", "rig.horizontal_fov=60"], "set either rig.focal_length or"),
        (["rig.height=3", "rig.baseline=-1"], "(and 1 more fault)"),
        (["measurement=file", "seed=1"], "measurement.path: is missing"),
        (["measurement=file", "measurement.path=''"], "measurement.path: is empty"),
        (["measurement=file", "measurement.path=none.csv"], "none.csv is missing"),
        (["measurement=file", "measurement.path=."], "must be a table with the suffix"),
        (["start=scans", "start.bearing=[3,1]"], "start.bearing: the second must be greater"),
        (["pace.speed=3", "path=approach"], "pace.speed: unknown key; did you mean path.speed?"),
    ],
)
def test_words_that_do_not_go_together(words, message, capsys):
    assert message in say_one_line(words, capsys)


@pytest.mark.parametrize("group", group_options())
def test_near_misses_of_options(group, capsys):
    for option in group_options()[group]:
        miss = option[:-1] if option[:-1] not in group_options()[group] else option + "x"
        if len(option) > 2:
            words = [*around(group), f"{group}={miss}"]
            assert f"{group}={option}" in say_one_line(words, capsys)


def chosen(key) -> list[str]:
    """Options with which there is such a key."""
    return [f"{group}={options_of_kind(group, kind)[0]}" for group, kind in key.owners]


def around(group) -> list[str]:
    """What has to be chosen for a group within another to be there."""
    outer = group.rpartition("/")[0]
    return [f"{outer}={outer_options(group)[0]}"] if outer else []


def wrong_value(key) -> Any:
    """A value of the wrong type, or far out of range, as it is typed."""
    words = describe(key.annotation)
    return "{a: 1}" if words.startswith("text") else "-1e9" if "number" in words else "xyzzy"


OVERRIDES = ("run", "sweep", "sweep --dry-run", "explain")
FOLDERS = ("verify", "report --format md", "report --format pdf", "report")


@pytest.mark.parametrize("name", list(known_keys())[1::18])
@pytest.mark.parametrize("command", ["sweep", "explain"])
def test_one_wrong_value_of_many_is_named_before_anything_runs(command, name, capsys):
    key = known_keys()[name][0]
    choice = chosen(key)
    wrong = wrong_value(key)
    said = say_one_line([*choice, "seed=0,1", f"{name}={wrong},{wrong}1"], capsys, command)
    assert name in said


@pytest.mark.parametrize("group", [g for g, options in group_options().items() if len(options) > 1])
def test_sweeps_of_options(group, capsys):
    first, second = group_options()[group][:2]
    for words in (
        [f"{group}={first},{second}x"],
        [f"{group}={first},{first}"],
        [f"{group}={first},{second}", f"{group}={first}"],
        [f"{group}=glob(nothing*)"],
    ):
        said = say_one_line([*around(group), *words], capsys, "sweep")
        assert f"{group}=" in said or f"{group}:" in said


@pytest.mark.parametrize("command", ["sweep", "explain"])
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["seed=interval(0,1)"], "interval"),
        (["seed=shuffle(0,1)"], "not supported"),
        (["seed=0,1", "~rig"], "no key can be added or removed"),
        (["+tracker.news=0,1"], "unknown key"),
        (["rig=kitti,default", "rig.focal_length=3", "rig.horizontal_fov=50"], "rig.focal_length"),
        (["cache.max_size=much", "seed=0,1"], "cache.max_size: 'much' is not a valid size"),
        (["rig.width=" + "x" * 5000 + ",64"], "…' is text: must be a whole number"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_sweeps_that_cannot_be_meant(command, words, said, capsys):
    assert said in say_one_line(words, capsys, command)


def test_a_file_of_many_aliases_is_refused_before_it_is_expanded(tmp_path_factory, capsys):
    bomb = tmp_path_factory.mktemp("files") / "bomb.yaml"
    levels = [f"- &{b} [{', '.join([f'*{a}'] * 8)}]" for a, b in pairwise("abcdefg")]
    bomb.write_text("\n".join(["axes:", "- &a [1, 2]", *levels]))
    said = say_one_line(["--from", str(bomb)], capsys, "sweep")
    assert "bomb.yaml: more than 50000 values, aliases expanded" in said


@pytest.mark.parametrize("command", OVERRIDES)
@pytest.mark.parametrize(
    "words",
    [["rig.width=wide"], ["seed=1", "seed=1"], ["executor.address=tcp://a:1"], ["cache.folder=3"]],
    ids=lambda words: words[0],
)
def test_every_command_that_takes_overrides_refuses_them_alike(command, words, capsys):
    say_one_line(words, capsys, command)


@pytest.mark.parametrize("command", FOLDERS)
def test_folders_that_are_none(command, tmp_path_factory, capsys):
    there = tmp_path_factory.mktemp("there")
    file, empty = there / "file", there / "empty"
    file.write_text("text")
    empty.mkdir()
    more = [str(empty)] if command.startswith("report") else []
    for folder in (there / "nowhere", file, empty / ".." / "empty", "", "\0", "a\nb"):
        say_one_line([str(folder), *more], capsys, command)
    assert "missing argument" in say_one_line([], capsys, command)
    assert "not the result folder of a run" in say_one_line(
        [str(empty), *([str(there)] if more else [])], capsys, command
    )


LINES = {
    "run --wrokers 3": "did you mean --workers?",
    "run --dryrun": "did you mean --dry-run?",
    "run --nmae=a": "did you mean --name?",
    "run --seed=3": "did you mean seed=… without the dashes?",
    "run --rig.width 3": "did you mean rig.width=… without the dashes?",
    "run --road_user=car": "did you mean road_user=…",
    "run -m seed=1,2": "`stixel sweep KEY=1,2,3`",
    "run --multirun seed=1,2": "`stixel sweep KEY=1,2,3`",
    "--verison": "did you mean --version?",
    "run --xyzzy": "no such option --xyzzy (see stixel run --help)",
    "ls -z": "no such option -z",
    "run --name": "requires an argument (see stixel run --help)",
    "path.duration=1": "did you mean stixel run path.duration=1?",
    "run --workers many": "'--workers'",
    "rnu": "did you mean run?",
    "xyzzy": "no such command 'xyzzy'",
    "report": "missing argument",
    "report a b --format doc": "'--format': 'doc' is not one of",
    "cache": "missing command",
    "cache lss": "did you mean ls?",
    "cache clear": "add --yes",
    "cache verify all": "unexpected extra argument",
    "cache gc --max-size much": "--max-size: 'much' is not a valid size: write 500MB",
    "cache gc --older-than old": "--older-than: 'old' is not a valid age: write",
    "describe tracker.sigma": "tracker.sigma_f",
    "describe traker": "tracker",
    "describe tracker=pont": "tracker=point",
    "describe NEES": "did you mean nees_position_mean or",
    **{
        f"{command} {words}": said
        for command in ("assess", "stixels")
        for words, said in {
            "left.png": "needs two images, LEFT and RIGHT",
            "a.png b.png c.png": " needs two images, LEFT and RIGHT, or one recording, got 3",
            "left.png right.png": "--rig: is required with two images",
            "left.png right.png --rig rig.yaml": "rig.yaml",
            "source.folder=x --calib rig.yaml": "belongs to two images",
        }.items()
    },
}
REFUSED = """
run --workers 0
run --workers 2 executor.workers=3
run x/y --workers -1
verify x --workers two
sweep --workers 0 seed=0,1
sweep --resume nowhere
sweep --resume .
sweep --resume nowhere seed=1
sweep --from
sweep --dry-run --from .
ls nowhere
ls one two
doctor me
explain no/such/folder
explain . seed=1
run no/such/folder
run . seed=1
run --dry-run .
describe seed --schema x
assess --calibrate
assess --calibrate --stixels x.stx1
assess --calibrate seed=0 --stixels x.stx1
report . --play --format md
new
"""


@pytest.mark.parametrize("line", [*LINES, *REFUSED.strip().splitlines()])
def test_lines_of_every_command(line, capsys):
    assert LINES.get(line, "") in say_one_line(line.split(), capsys, "")


@pytest.mark.parametrize(
    "words",
    [
        ["run", b"rig.width=\xff\xfe"],
        ["run", "road_user.mesh=\u00e9\u4e2d.obj"],
    ],
    ids=ascii,
)
def test_real_processes(words, tmp_path):
    # An ASCII terminal must not make a crash of a message.
    environment = {"PATH": "/usr/bin:/bin", "PYTHONIOENCODING": "ascii", "HOME": str(tmp_path)}
    environment["PYTHONPATH"] = ":".join(sys.path)
    done = subprocess.run(
        [sys.executable, "-m", "stixel_cli", *words],
        capture_output=True,
        env=environment,
        cwd=tmp_path,
    )
    assert done.returncode == 2, done.stderr
    assert done.stdout == b""
    assert done.stderr.count(b"\n") == 1
    assert done.stderr.startswith(b"stixel: ")
