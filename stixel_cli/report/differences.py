"""The settings that differ between runs, and what makes runs hard to compare."""

from collections.abc import Sequence
from typing import Any

from stixel_cli.report.metrics import NO_VALUE
from stixel_cli.results.reader import flat_settings
from stixel_cli.results.result import RunResult


def differing_settings(
    runs: Sequence[RunResult],
) -> tuple[list[Any], list[tuple[str, str]]]:
    """Different settings as (key, value of each run), and equal ones as (key, value)."""
    flat = [flat_settings(run.settings) for run in runs]
    tables = [_choices(run, settings) | settings for run, settings in zip(runs, flat, strict=True)]
    keys = list(dict.fromkeys(key for table in tables for key in table))
    groups = list(dict.fromkeys(key.partition(".")[0] for key in keys))
    keys.sort(key=lambda key: groups.index(key.partition(".")[0]))
    differing, same = [], []
    for key in keys:
        values = [table.get(key, NO_VALUE) for table in tables]
        if len(set(values)) > 1:
            differing.append((key, values))
        else:
            same.append((key, values[0]))
    return differing, same


def by_group(differing: Sequence[tuple[str, list[str]]]) -> list[dict[str, Any]]:
    """Different settings as rows: key, values, and the settings `inside` an exchanged group.

    A group is exchanged if its option or kind differs: its other keys follow from that.
    """
    names = {key for key, _ in differing}
    rows: list[dict[str, Any]] = []
    for key, values in differing:
        group, _, rest = key.partition(".")
        exchanged = f"{group}.kind" in names or group in names
        if exchanged and rows and rows[-1]["key"] == group:
            if rest != "kind":
                rows[-1]["inside"].append((key, values))
        elif exchanged:
            shown = next(own for name, own in differing if name in (group, f"{group}.kind"))
            inside = [] if rest in ("", "kind") else [(key, values)]
            rows.append({"key": group, "values": shown, "inside": inside})
        else:
            rows.append({"key": key, "values": values, "inside": []})
    return rows


_SCENE = ("road_user", "path", "ego", "world", "rig", "source")


def warnings(runs: Sequence[RunResult]) -> list[str]:
    """Reasons why a difference of the metrics may not be one of the method."""
    found = []
    ends = [float(run.scores.times[-1]) if len(run.scores.times) else 0.0 for run in runs]
    counts = {len(run.scores.times) for run in runs}
    if len(set(ends)) > 1 or len(counts) > 1:
        shown = ", ".join(f"{end:g} s" for end in ends)
        found.append(f"The durations differ ({shown}): the metrics are over other scans.")
    groups = [g for g in _SCENE if len({str(run.settings.get(g)) for run in runs}) > 1]
    if groups:
        found.append(
            f"The scenes differ ({', '.join(groups)}): the metrics compare other motions or views."
        )
    seeds = {str(run.settings.get("seed")) for run in runs}
    if len(seeds) > 1:
        found.append("The seeds differ: a difference may be that of the noise.")
    return found


def _choices(run: RunResult, settings: dict[str, str]) -> dict[str, str]:
    """The chosen option of each group whose settings have no `kind`."""
    return {g: option for g, option in run.choices.items() if f"{g}.kind" not in settings}
