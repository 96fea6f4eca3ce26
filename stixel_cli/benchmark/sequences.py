"""The sequences of the benchmark: names, settings, and the sets that consist of them."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.texts import override_text
from stixel_cli.errors import UserError
from stixel_cli.files import read_yaml
from stixel_cli.sweeps.runs import PlannedRun, compose_runs

FROZEN, HARD = "frozen", "hard"
"""The parts of version 1.0; the first one is ranked."""

FRESH_SEEDS = 10
FIRST_FRESH_SEED, LAST_FRESH_SEED = 10_000, 10_000_000
"""Nobody tunes on these: seeds to tune on are 1000 to 1999, those of the frozen part 0 to 9."""


@dataclass(frozen=True)
class Sequence:
    """One sequence: the key of all files and rows is its `name`."""

    part: str
    sensor: str
    road_user: str
    case: str
    seed: int

    @property
    def name(self) -> str:
        """`SENSOR-ROAD_USER-CASE-SEED`."""
        return f"{self.sensor}-{self.road_user}-{self.case}-{self.seed}"

    @property
    def scene(self) -> tuple[str, str, int]:
        """What sequences of several sensors share: the unit of all statistics."""
        return self.road_user, self.case, self.seed

    @property
    def overrides(self) -> list[str]:
        """Of `stixel run`; the seed of the shape is that of the sequence."""
        case = definitions()["parts"][self.part]["cases"][self.case]
        settings = {
            "road_user": self.road_user,
            "seed": self.seed,
            "road_user.shape_seed": self.seed,
            **definitions()["sensors"][self.sensor],
            **{k: v[self.road_user] if isinstance(v, dict) else v for k, v in case.items()},
        }
        return [override_text(key, value) for key, value in settings.items()]


def bench_folder() -> Path:
    """`pipelines/bench`: the definitions, the schema of packs, the rows."""
    return shipped_folder("pipelines") / "bench"


@cache
def definitions() -> dict[str, Any]:
    """The content of `pipelines/bench/sequences.yaml`."""
    return read_yaml(bench_folder() / "sequences.yaml")


def sequences(part: str, seeds: Iterable[int] | None = None) -> list[Sequence]:
    """The sequences of a part, or of its sensors and cases with other `seeds`."""
    content = definitions()["parts"][part]
    seeds = None if seeds is None else list(seeds)
    return [
        Sequence(part, sensor, road_user, case, seed)
        for road_user in definitions()["road_users"]
        for case in content["cases"]
        for sensor, own in content["seeds"].items()
        for seed in (own if seeds is None else seeds)
    ]


def whole_set() -> list[Sequence]:
    """Version 1.0: both parts."""
    return [*sequences(FROZEN), *sequences(HARD)]


def mini_set() -> list[Sequence]:
    """The part of it to develop on."""
    return sequences(FROZEN, definitions()["mini_seeds"])


def fresh_set(pack: str) -> list[Sequence]:
    """Sequences on ten seeds that the SHA-256 of a pack draws, in hexadecimal: one case a seed."""
    digests = (hashlib.sha256(f"{pack} {i}".encode()).digest() for i in range(FRESH_SEEDS))
    span = LAST_FRESH_SEED - FIRST_FRESH_SEED
    seeds = [FIRST_FRESH_SEED + int.from_bytes(one[:8], "big") % span for one in digests]
    cases = list(definitions()["parts"][FROZEN]["cases"])
    case_of = {seed: cases[i % len(cases)] for i, seed in enumerate(seeds)}
    return [one for one in sequences(FROZEN, seeds) if case_of[one.seed] == one.case]


def named(name: str) -> Sequence:
    """The sequence of a name; UserError if its sensor, class, case or seed is unknown."""
    words = name.split("-")
    for part, content in definitions()["parts"].items():
        match words:
            case [sensor, road_user, case, seed] if (
                sensor in content["seeds"]
                and road_user in definitions()["road_users"]
                and case in content["cases"]
                and seed.isdecimal()
                and len(seed) < 10
            ):
                return Sequence(part, sensor, road_user, case, int(seed))
    raise UserError(f"{name[:80]!r}: not the name of a sequence, such as stixels-car-turn-0")


def planned(chosen: Iterable[Sequence], further: Mapping[str, Any]) -> list[PlannedRun]:
    """The experiments of sequences, composed, in their order; `further` overrides for all."""
    more = [override_text(key, value) for key, value in further.items()]
    return compose_runs([[*one.overrides, *more] for one in chosen], ["seed"], Composer())
