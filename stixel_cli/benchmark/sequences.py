"""The sequences of the benchmark: names, settings, and the sets that consist of them."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from stixel_cli.border import TYPED
from stixel_cli.config.compose import Composer
from stixel_cli.config.folders import shipped_folder
from stixel_cli.config.override_checks import read_overrides
from stixel_cli.config.texts import override_text
from stixel_cli.errors import MissingData, UserError
from stixel_cli.files import read_json, read_yaml
from stixel_cli.results.result import RunResult
from stixel_cli.studies.report import data_folder
from stixel_cli.sweeps.runs import compose_runs

FROZEN = "frozen"
"""The part that is ranked."""
FRESH_SEEDS, FIRST_FRESH_SEED, FRESH_SPAN = 10, 10_000, 10_000_000
"""Far from the seeds to tune on, 1000 to 1999, and from those of version 1.0."""


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
    def overrides(self) -> list[str]:
        """Of `stixel run`; the seed of the shape is that of the sequence."""
        case = definitions()["parts"][self.part]["cases"][self.case]
        own = {k: v[self.road_user] if isinstance(v, dict) else v for k, v in case.items()}
        settings = {"road_user": self.road_user, "seed": self.seed}
        settings |= {"road_user.shape_seed": self.seed, **definitions()["sensors"][self.sensor]}
        given = {key: v for key, v in (settings | own).items() if v is not None}
        return [override_text(key, self._filled(value)) for key, value in given.items()]

    def _filled(self, value: Any) -> Any:
        """A text of the definitions with its places filled in; * is the seed's place in it."""
        if not isinstance(value, str) or "{" not in value:
            return value
        if value == "{seed}":
            return self.seed
        data = data_folder("the user's recordings") if "{data}" in value else ""
        text = value.format(bench=bench_folder(), data=data, **vars(self))
        before, star, after = text.partition("*")
        if not star:
            return text
        found = sorted(Path(before).parent.glob(f"{Path(before).name}*{after}"))
        if len(found) <= self.seed:
            raise MissingData(f"{self.name}: {text}: has {len(found)} files")
        return str(found[self.seed])


def bench_folder() -> Path:
    """`pipelines/bench`: the definitions, the schema of packs, the rows."""
    return shipped_folder("pipelines") / "bench"


@cache
def definitions() -> dict[str, Any]:
    """The content of `sequences.yaml` there."""
    return read_yaml(bench_folder() / "sequences.yaml")


def published() -> dict[str, str]:
    """SHA-256 by path of the published mini set."""
    file = bench_folder() / "MANIFEST-mini.json"
    return read_json(file)["files"] if file.exists() else {}


def sequences(part: str, seeds: Iterable[int] = ()) -> list[Sequence]:
    """The sequences of a part; with `seeds`, these of all its sensors and cases."""
    if part not in (parts := definitions()["parts"]):
        raise UserError(f"{part[:80]!r}: is not a part: must be one of {', '.join(parts)}")
    content, seeds = parts[part], list(seeds)
    return [
        Sequence(part, sensor, road_user, case, seed)
        for road_user in content.get("road_users", definitions()["road_users"])
        for case in content["cases"]
        for sensor, own in content["seeds"].items()
        for seed in seeds or (own[road_user] if isinstance(own, dict) else own)
    ]


def whole_set(mini: bool = False) -> list[Sequence]:
    """Version 1.0: its parts; or the mini set, the part of it to develop on."""
    if mini:
        return sequences(FROZEN, definitions()["mini_seeds"])
    return [one for part in definitions()["whole"] for one in sequences(part)]


def fresh_set(pack: str) -> list[Sequence]:
    """Sequences on ten seeds that the SHA-256 of a pack draws, in hexadecimal: one case a seed."""
    cases, found = list(definitions()["parts"][FROZEN]["cases"]), []
    for i in range(FRESH_SEEDS):
        number = int(hashlib.sha256(f"{pack} {i}".encode()).hexdigest()[:16], 16)
        drawn = sequences(FROZEN, [FIRST_FRESH_SEED + number % FRESH_SPAN])
        found += [one for one in drawn if one.case == cases[i % len(cases)]]
    return found


def named(name: str) -> Sequence:
    """The sequence of a name, of any seed; UserError if its sensor, class or case is unknown."""
    seed = name.rpartition("-")[2]
    if seed.isdecimal() and len(seed) < 10:
        every = (one for part in definitions()["parts"] for one in sequences(part, [int(seed)]))
        for one in (one for one in every if one.name == name):
            return one
    raise UserError(f"{name[:80]!r}: not the name of a sequence, such as stixels-car-turn-0")


def planned(chosen: Iterable[Sequence], further: Mapping[str, Any]) -> list[RunResult]:
    """The experiments of sequences, composed, in their order; `further` settings, as typed."""
    more = read_overrides((override_text(key, value) for key, value in further.items()), TYPED)
    each = [[*read_overrides(one.overrides, TYPED), *more] for one in chosen]
    return compose_runs(each, ["seed"], Composer())
