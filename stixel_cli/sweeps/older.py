"""Points that are finished, and are not what would come out now: how many, and why."""

from collections import Counter
from collections.abc import Sequence

from stixel_cli.errors import UserError
from stixel_cli.experiment.stored_run import OF_THE_MACHINE
from stixel_cli.results.causes import first_changed_stage
from stixel_cli.results.lineage import lineage_of, read_lineage
from stixel_cli.results.reader import flat_settings, read_config
from stixel_cli.sweeps.folder import SweepFolder
from stixel_cli.sweeps.graphs import PlannedPoint

MOST_REASONS = 3
_OTHER_SETTINGS = "other settings"
_UNKNOWN = "the folder does not say of what"


def older_points(folder: SweepFolder, planned: Sequence[PlannedPoint]) -> str | None:
    """In one line, how many finished points were made of something else; None if none was."""
    finished = 0
    reasons: Counter[str] = Counter()
    for one in planned:
        results = folder.results(one.point.index)
        if results is None:
            continue
        finished += 1
        if results != list(one.targets):
            reasons[_reason(folder, one)] += 1
    if not reasons:
        return None
    count = sum(reasons.values())
    shown = [reason for reason, _ in reasons.most_common(MOST_REASONS)]
    shown += ["…"] if len(reasons) > MOST_REASONS else []
    were, are = ("was", "is") if count == 1 else ("were", "are")
    return (
        f"{count} of {finished} finished points {were} made of something else than there is now "
        f"({'; '.join(shown)}) and {are} computed again"
    )


def _reason(folder: SweepFolder, one: PlannedPoint) -> str:
    """The first stage of a point that is made of something else, and of what."""
    path = folder.point(one.point.index)
    try:
        before = read_lineage(path)
        if before is None:
            return _UNKNOWN
        after = lineage_of(one.graph, one.graph.ancestors(one.targets), None)
        found = first_changed_stage(before, after, one.graph, _OTHER_SETTINGS)
        if found is None:
            return "other results were asked for"
        causes = [_settings(folder, one) if c == _OTHER_SETTINGS else c for c in found.causes]
    except UserError:
        return _UNKNOWN
    if not found.known:
        return f"{found.stage} is new"
    more = f" and {len(causes) - 1} more" if len(causes) > 1 else ""
    return f"{found.stage}: {causes[0] if causes else 'its inputs are others'}{more}"


def _settings(folder: SweepFolder, one: PlannedPoint) -> str:
    """Which settings are not those of the point's configuration."""
    before = flat_settings(read_config(folder.point(one.point.index)))
    after = flat_settings(one.point.composition.resolved)
    other = [
        f"{key} {before.get(key, 'none')} → {after.get(key, 'none')}"
        for key in dict.fromkeys((*before, *after))
        if before.get(key) != after.get(key) and key.partition(".")[0] not in OF_THE_MACHINE
    ]
    return other[0] if other else _OTHER_SETTINGS
