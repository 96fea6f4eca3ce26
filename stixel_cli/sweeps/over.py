"""The axes of a sweep that its means are over: what is a setting, a unit, and a pair of runs.

An axis whose key ends in `seed` is drawn: another draw would give other runs, and the interval
says by how much. Other axes, such as paths, are a given set: each draw is averaged over them first.
Where only given axes are averaged over, they count as drawn.
"""

from collections.abc import Mapping, Sequence

from stixel_cli.config.messages import printable
from stixel_cli.errors import ConfigurationError
from stixel_cli.evaluation.metric_table import metric
from stixel_cli.report.intervals import CONFIDENCE
from stixel_cli.report.statistics import Statistic, Unit, excludes_zero, statistic
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.design import SEED

Axes = tuple[tuple[str, ...], ...]
"""Axes, each as its keys."""
Setting = tuple[tuple[str, str], ...]
"""The keys that differ between runs and are not averaged over, with their values as typed."""
OVER_SEEDS: Axes = ((SEED,),)


def over_axes(names: str | Sequence[str], axes: Sequence[Sequence[str]]) -> Axes:
    """Those of a sweep's axes that have one of the keys `names`, a list or separated by commas.

    Raises:
        ConfigurationError: for a key that no axis has.
    """
    names = names.split(",") if isinstance(names, str) else list(names)
    swept = [key for axis in axes for key in axis]
    if names == [SEED] and SEED not in swept:
        return OVER_SEEDS
    for name in (name for name in names if name not in swept):
        raise ConfigurationError(
            f"over: {printable(name, 60)} is not swept; swept: {', '.join(swept) or 'nothing'}"
        )
    return tuple(tuple(axis) for axis in axes if set(axis) & set(names))


def levels_of(run: RunResult) -> dict[str, str]:
    """The values of all swept keys of a run, of the seed too."""
    return run.setting | {SEED: str(run.manifest.get("seed", ""))}


def setting_of(run: RunResult, over: Axes) -> Setting:
    """The values of the keys that are not averaged over."""
    averaged = {key for axis in over for key in axis}
    levels = run.setting if SEED in averaged else levels_of(run)
    return tuple((key, value) for key, value in levels.items() if key not in averaged)


def unit_of(run: RunResult, over: Axes) -> Unit:
    """What is drawn of a run: the level of each drawn axis."""
    levels = levels_of(run)
    drawn = [axis for axis in over if any(key.endswith(SEED) for key in axis)] or over
    return tuple(" ".join(levels.get(key, "") for key in axis) for axis in drawn)


def behind_best(
    name: str, groups: Mapping[Setting, Sequence[RunResult]], over: Axes
) -> dict[Setting, Statistic]:
    """Each setting's metric minus the best setting's, over pairs of runs that are averaged alike.

    All intervals hold together with 95 % (Bonferroni), since the best one is chosen among them.
    Empty for a metric of which neither more nor less is better, or with a value in one setting
    only.
    """
    sign = {"more": -1.0, "less": 1.0}.get(metric(name).better)
    keys = [key for axis in over for key in axis]
    values: dict[Setting, dict[Unit, tuple[Unit, float]]] = {}
    for setting, runs in groups.items():
        pairs = ((r, levels_of(r), r.metrics.get(name)) for r in runs)
        own = {
            tuple(levels.get(key) for key in keys): (unit_of(run, over), value)
            for run, levels, value in pairs
            if value is not None
        }
        values |= {setting: own} if own else {}
    if sign is None or len(values) < 2:
        return {}
    means = {s: statistic("", (v for _, v in own.values())).mean for s, own in values.items()}
    best = values[min(means, key=lambda setting: sign * means[setting])]
    confidence = 1.0 - (1.0 - CONFIDENCE) / (len(values) - 1)
    found = {}
    for setting, own in values.items():
        both = [(own[pair], best[pair][1]) for pair in own if pair in best]
        differences = [value - other for (_, value), other in both]
        found[setting] = statistic("", differences, [u for (u, _), _ in both], confidence)
    return found


def marks(differences: Mapping[Setting, Statistic]) -> dict[Setting, str]:
    """`best` for the setting that all others are behind; else `tied` for those that are not.

    Empty if an interval is unknown: with a run of each, chance may have chosen.
    """
    others = {s: one for s, one in differences.items() if (one.mean, one.std) != (0.0, 0.0)}
    if not others or any(one.low is None for one in others.values()):
        return {}
    behind = {setting for setting, one in others.items() if excludes_zero(one)}
    first = [setting for setting in differences if setting not in behind]
    return dict.fromkeys(first, "best" if len(first) == 1 else "tied")
