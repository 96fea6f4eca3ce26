"""Resume a sweep: other executors or caches, runs that are out of date, the note of the resume."""

import os
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from stixel_cli.config.folders import OF_THE_MACHINE, PRESETS, of_the_machine
from stixel_cli.config.override_checks import check_overrides, read_overrides
from stixel_cli.config.texts import override_text
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.results.differences import first_changed_stage
from stixel_cli.results.lineage import lineage_of, read_lineage
from stixel_cli.results.reader import flat_settings, read_config
from stixel_cli.results.result import RunResult
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.runs import PlannedRun

MOST_REASONS = 3
_OTHER_SETTINGS = "other settings"
_UNKNOWN = "no usable lineage in its folder"


def on_this_machine(
    runs: Sequence[Sequence[str]], overrides: Sequence[str]
) -> list[tuple[str, ...]]:
    """The overrides of each run, with those of executor and cache replaced by `overrides`.

    Nothing of these groups is kept: somebody else may have written the folder, and a cache holds
    pickles, a scheduler's address a computer.

    Raises:
        ConfigurationError: in one line, for an override of any other group, or of several values.
    """
    parsed, given = read_overrides(overrides), []
    for override in parsed:
        if not of_the_machine(override.key):
            raise ConfigurationError(
                f"{override.shown}: --resume keeps the settings in the folder: only keys of "
                f"{' and '.join(OF_THE_MACHINE)}, which do not affect results, can be changed"
            )
        if override.sweep is not None:
            raise ConfigurationError(f"{override.shown}: --resume: one value is needed")
        text, folder = override.text, override.value
        if override.key == "cache.folder" and isinstance(folder, str) and folder:
            # Paths of the runs refer to the sweep's working directory, this one to today's.
            text = override_text("cache.folder", os.path.abspath(os.path.expanduser(folder)))
        given.append(text)
    check_overrides(parsed)
    return [(*(text for text in texts if not of_the_machine(text)), *given) for texts in runs]


def resume_command(path: Path, overrides: Sequence[str] = ()) -> str:
    """The command line that resumes a sweep, with those of a run's overrides that it needs."""
    machine = [text for text in overrides if of_the_machine(text)]
    return shlex.join(["stixel", "sweep", "--resume", str(path), *machine, *PRESETS.option])


def outdated_runs(
    folder: SweepFolder, planned: Sequence[PlannedRun], finished: Mapping[int, RunResult]
) -> str | None:
    """One line that counts the finished runs that are out of date, with causes; None if none is."""
    there = [one for one in planned if one.index in finished]
    outdated = [one for one in there if not one.is_done_by(finished[one.index])]
    if not outdated:
        return None
    count, reasons = len(outdated), Counter(_reason(folder, one) for one in outdated)
    shown = [reason for reason, _ in reasons.most_common(MOST_REASONS)]
    shown += ["…"] if len(reasons) > MOST_REASONS else []
    return (
        f"{count} of {len(finished)} finished runs {'is' if count == 1 else 'are'} out of date and "
        f"will be recomputed ({'; '.join(shown)})"
    )


def _reason(folder: SweepFolder, one: PlannedRun) -> str:
    """The first stage of a run whose key changed, and the cause."""
    path = folder.run(one.index)
    try:
        before = read_lineage(path)
        if before is None:
            return _UNKNOWN
        after = lineage_of(one.graph, one.graph.ancestors(one.targets), None)
        found = first_changed_stage(before, after, one.graph, _OTHER_SETTINGS)
        if found is None:
            return "other results are required"
        causes = [_settings(folder, one) if c == _OTHER_SETTINGS else c for c in found.causes]
    except UserError:
        return _UNKNOWN
    if found.stage not in before.stages:
        return f"{found.stage} is new"
    more = f" and {len(causes) - 1} more" if len(causes) > 1 else ""
    return f"{found.stage}: {causes[0] if causes else 'its inputs changed'}{more}"


def _settings(folder: SweepFolder, one: PlannedRun) -> str:
    """The first setting that differs from the run's stored configuration."""
    before = flat_settings(read_config(folder.run(one.index)))
    after = flat_settings(one.composition.resolved)
    other = [
        f"{key} {before.get(key, 'none')} → {after.get(key, 'none')}"
        for key in dict.fromkeys((*before, *after))
        if before.get(key) != after.get(key) and key.partition(".")[0] not in OF_THE_MACHINE
    ]
    return other[0] if other else _OTHER_SETTINGS
