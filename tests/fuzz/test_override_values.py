"""Every key of the configuration with values of every type, on `run --dry-run` and on `explain`.

What `run` takes, `explain` takes, and the configuration that is printed is read again as it is: a
result folder holds it.
"""

import json
import math
import random
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from harness_of_fuzz import Answer, Kind, answer, run_cases, settle
from odd_values import INTERPOLATIONS, LISTS, NUMBERS, ODD, SWEEPS, TYPED, WORDS

from stixel_cli.config.annotations import choices, describe
from stixel_cli.config.compose import from_resolved
from stixel_cli.config.folders import group_options, options_of_kind
from stixel_cli.config.keys import known_keys

SMALL = 15


def draw_value(rng: random.Random, annotation: Any) -> str:
    """A value, mostly one that has not been thought of; else from the ends of what is allowed."""
    words, how = choices(annotation), rng.random()
    if words and how < 0.5:
        return rng.choice(words)
    ends = re.findall(r"-?\d+(?:\.\d+)?", describe(annotation))
    if ends and how < 0.5:
        end = float(rng.choice(ends))
        near = (end, math.nextafter(end, math.inf), math.nextafter(end, -math.inf), end + 1, -end)
        value = rng.choice((*near, end / 2, end - 1, end / 1000))
        return str(int(value)) if value == int(value) and rng.random() < 0.8 else repr(value)
    kinds = (ODD, NUMBERS, LISTS, SWEEPS, INTERPOLATIONS, WORDS, TYPED, TYPED)
    return rng.choice(rng.choice(kinds))


def draw_overrides(rng: random.Random) -> list[str]:
    """One to three keys with a value each, and the options that have those keys."""
    chosen: dict[str, str] = {}
    values = []
    for name in rng.sample(list(known_keys()), rng.choice((1, 1, 1, 2, 3))):
        key = rng.choice(known_keys()[name])
        # The path of a recording has no option.
        kinds = {group: options_of_kind(group, kind) for group, kind in key.owners}
        chosen |= {group: rng.choice(options) for group, options in kinds.items() if options}
        values.append(f"{name}={draw_value(rng, key.annotation)}")
    group = rng.choice(list(group_options()))
    if rng.random() < 0.3 and "/" not in group:
        chosen.setdefault(group, rng.choice(group_options()[group]))
    return [*(f"{group}={option}" for group, option in chosen.items()), *values]


def draw_words(rng: random.Random, place: Path) -> list[str]:
    """A run that prints its configuration, or an explanation of its nodes."""
    words = rng.choice((["run", "--json", "--dry-run"], ["explain", "--json"]))
    return [*words, *draw_overrides(rng)]


def disagreement(words: list[str], got: Answer) -> str:
    """What is wrong if the other command refuses what one takes, or a folder's reader does."""
    if got.code != 0:
        return ""
    overrides = [word for word in words[1:] if not word.startswith("--")]
    if words[0] == "explain":
        run = answer(["run", "--json", "--dry-run", *overrides])
        return "" if run.code == 0 or "several values" in run.err else f"run refuses: {run.err}"
    resolved = json.loads(got.out)["config"]
    if json.loads(json.dumps(asdict(from_resolved(resolved)))) != resolved:
        return "the configuration is another one when it is read again"
    why = answer(["explain", "--json", *overrides])
    return "" if why.code == 0 else f"explain refuses: {why.err}"


def test_each_is_answered(tmp_path, monkeypatch):
    place = settle(monkeypatch, tmp_path)
    run_cases(Kind("override value", draw_words, place, also=disagreement), SMALL)
