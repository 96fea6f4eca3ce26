"""Command lines of random words: right ones, wrong ones, and what no one would type."""

import random
from pathlib import Path

import typer
from harness_of_fuzz import Kind, run_cases, settle
from odd_values import INTERPOLATIONS, LISTS, NUMBERS, ODD, SWEEPS

from stixel_cli.cli.app import application
from stixel_cli.config.folders import group_options
from stixel_cli.config.keys import known_keys

SMALL = 18


def _commands(group, before: tuple[str, ...] = ()):
    """Each command, as words, with the options that it declares."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*before, name))
        else:
            options = [text for one in command.params for text in one.opts if text[0] == "-"]
            yield (*before, name), [*options, "--help", "-h"]


COMMANDS = dict(_commands(typer.main.get_command(application(""))))
OVERRIDES = [("run",), ("sweep",), ("explain",)]
INCOMPLETE = [[], ["cache"], ["completion"], ["study", "--dry-run", "rq2"], ["doctor", "x"]]
NAMES = ("x", ".", "..", "../x", "a/b", "/", "~", "-", "rq2", "prior_width", "here", "here/x")


RIGHT = (
    "run --dry-run road_user=pedestrian path=crossing rig.width=320",
    "run --dry-run --json path=waypoints path.points=[[0,12],[3,15],[0,20]] --workers 2",
    "run --dry-run measurement=fabricated measurement/noise=constant tracker.length_scale=0.6",
    "run --dry-run rig=kitti stereo=bm --name kitti-bm seed=3",
    "sweep --dry-run tracker.length_scale=0.2,0.4 seed=range(0,3) --pictures",
    "sweep --dry-run --from prior_width seed=choice(1,2) measurement=fabricated",
    "sweep --dry-run road_user=glob(*) path=turn,s_curve measurement=fabricated",
    "sweep --dry-run --json tracker.sigma_f=range(0.1,0.5,0.2) tracker=gp_ekf --pictures",
    "explain rig.width=${rig.height} start.velocity=${path.speed} path=turn path.speed=3",
    "explain tracker.length_scale=0.5,0.6 seed=0,1 --json",
    "study --dry-run rq2 road_user=car seed=range(0,2) --name rq2-car",
    "cache gc --max-size 10GB --older-than 30d --dry-run",
    "run --dry-run executor=dask executor.address=tcp://a:1 cache.max_size=3GB seed=9",
)


def draw_value(rng: random.Random) -> str:
    """One value of an override."""
    text = rng.choice(rng.choice((ODD, NUMBERS, LISTS, SWEEPS, INTERPOLATIONS)))
    how = rng.random()
    if how < 0.08:
        return f"'{text}'"
    if how < 0.12:
        return f'"{text}"'
    if how < 0.16:
        return f"[{text},{draw_value(rng)}]"
    if how < 0.19:
        return f"{{a:{text}}}"
    if how < 0.24:
        return f"{text},{draw_value(rng)}"
    if how < 0.27:
        return f"choice({text},{draw_value(rng)})"
    if how < 0.30:
        return f" {text} "
    return text


def draw_override(rng: random.Random) -> str:
    """A key or group, mostly one that there is, and a value, mostly a wrong one."""
    groups, keys = group_options(), list(known_keys())
    how = rng.random()
    if how < 0.3:
        name = rng.choice(list(groups))
        value = rng.choice(groups[name]) if rng.random() < 0.7 else draw_value(rng)
    elif how < 0.85:
        name, value = rng.choice(keys), draw_value(rng)
    else:
        name, value = rng.choice((*ODD, *NUMBERS, *LISTS, "rig", "a.b.c", "rig.x", "path.kind")), ""
        value = draw_value(rng)
    how = rng.random()
    if how < 0.06:
        name = rng.choice(("+", "++", "~", "+~", "~~", "+++")) + name
    elif how < 0.09:
        name = name.replace(".", "/") if "." in name else name.replace("/", ".")
    elif how < 0.12:
        odd = (f"{name}.x", f"{name}@x", f"{name}@", f"@{name}", f"{name}[0]", f".{name}")
        name = rng.choice(odd)
        name = rng.choice((name, f"{name}.", f"{name}@:x", f"{name}@_global_", f"{name}@a:b"))
    elif how < 0.15:
        name = f" {name} "
    joint = rng.choice(("=",) * 20 + ("", "==", " = ", ":", "=="))
    return f"{name}{joint}{value}"


def draw_option(rng: random.Random, options: list[str]) -> list[str]:
    """One of a command's `options`, or nearly one, with a value or without."""
    how = rng.random()
    if how < 0.1:
        return [rng.choice(("-z", "-", "--", "---", "-hz", "--no-json", "--J", "-é", "--é=é"))]
    name = rng.choice(options)
    if how < 0.2:
        return [name + rng.choice(("x", "=", "=x", " ", "-", "\udcff"))]
    if how < 0.4:
        return [name]
    value = rng.choice(rng.choice((ODD, NUMBERS, NAMES, NAMES)))
    return [f"{name}={value}"] if rng.random() < 0.4 else [name, value]


def draw_near(rng: random.Random) -> list[str]:
    """A right command line with up to three characters of it changed."""
    words = rng.choice(RIGHT).split()
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        at = rng.randrange(len(words))
        start = rng.randrange(len(words[at]) + 1)
        stop = start + rng.choice((0, 0, 1, 1, 2, 9))
        new = rng.choice((*"=,.()[]{}+~-'\"$ \n0e:@/*é\udcff", "", words[at][start:stop] * 2))
        words[at] = words[at][:start] + new + words[at][stop:]
    return words


def draw_words(rng: random.Random, place: Path) -> list[str]:
    """A whole command line."""
    if rng.random() < 0.3:
        return draw_near(rng)
    kind = rng.random()
    command = rng.choice(OVERRIDES if kind < 0.6 else list(COMMANDS))
    options, words = COMMANDS[command], list(command)
    if kind < 0.3 and "--dry-run" in options:
        words.append("--dry-run")
    elif kind > 0.97:
        words = [rng.choice((*ODD, "swep", "Run", "run ", "--version", "--help", "-h"))]
    elif kind > 0.93:
        words = list(rng.choice(INCOMPLETE))
    if rng.random() < 0.3:
        words.insert(1, "--json")
    for _ in range(rng.choice((0, 1, 1, 1, 2, 2, 3, 5, 8))):
        how = rng.random()
        if how < 0.65:
            words.append(draw_override(rng))
        elif how < 0.9:
            words += draw_option(rng, options)
        else:
            words.append(rng.choice(rng.choice((ODD, NAMES))))
    return words


def test_each_is_answered(tmp_path, monkeypatch):
    place = settle(monkeypatch, tmp_path)
    run_cases(Kind("command line", draw_words, place), SMALL)
