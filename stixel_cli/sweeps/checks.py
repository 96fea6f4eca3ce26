"""Whether every axis of a sweep has an effect, known from the keys before anything runs."""

from collections import defaultdict
from collections.abc import Sequence

from stixel_cli.errors import ConfigurationError
from stixel_cli.sweeps.design import SEED
from stixel_cli.sweeps.graphs import PlannedRun


def check_axes(planned: Sequence[PlannedRun]) -> list[str]:
    """Refuse an axis that no stage reads; notes on those that only some runs' stages read.

    Two runs whose results have the same keys are the same experiment, whatever they are called.

    Raises:
        ConfigurationError: in one line that names the axis.
    """
    notes = []
    for key in planned[0].run.settings:
        if key.partition(".")[0] in ("executor", "cache"):
            raise ConfigurationError(f"{key}: no result depends on it: give it one value")
    for key in planned[0].run.settings:
        groups: dict[tuple, set[tuple[str, ...]]] = defaultdict(set)
        sizes: dict[tuple, int] = defaultdict(int)
        for one in planned:
            others = tuple(v for name, v in one.run.settings.items() if name != key)
            groups[others].add(one.targets)
            sizes[others] += 1
        several = [group for group, size in sizes.items() if size > 1]
        if not several:
            # Zipped with another, which has to be looked at instead of it.
            continue
        idle = [group for group in several if len(groups[group]) == 1]
        if len(idle) == len(several):
            raise ConfigurationError(_unread(key, planned))
        if idle and key != SEED:
            labels = [name for name in planned[0].run.settings if name != key]
            first = " ".join(f"{k}={v}" for k, v in zip(labels, idle[0], strict=True))
            notes.append(
                f"{key}: no stage reads it in {len(idle)} of {len(several)} settings of the other "
                f"axes ({first}), whose runs are equal"
            )
    return notes + _equal_runs(planned, notes)


def _unread(key: str, planned: Sequence[PlannedRun]) -> str:
    if key.startswith("pictures"):
        return f"{key}: a sweep draws no pictures unless --pictures is given: no stage reads it"
    choices = planned[0].run.composition.choices
    return (
        f"{key}: no stage reads it with measurement={choices.get('measurement')} and "
        f"path={choices.get('path')}: its runs would all be equal"
    )


def _equal_runs(planned: Sequence[PlannedRun], notes: list[str]) -> list[str]:
    if notes:
        return []
    seen: dict[tuple[str, ...], PlannedRun] = {}
    for one in planned:
        other = seen.setdefault(one.targets, one)
        if other is not one:
            return [
                f"runs {other.run.index} and {one.run.index} give equal results: "
                f"{other.run.label} and {one.run.label}"
            ]
    return []
