"""`stixel explain`: explain why results would be recomputed."""

import os
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from stixel_cli.cli.completion import complete_run_or_override
from stixel_cli.cli.options import ConfigDir, FromFile, Json, TrustCode, argument
from stixel_cli.cli.terminal import print_json, say
from stixel_cli.errors import UserError, printable_path

if TYPE_CHECKING:
    from stixel_cli.engine.explain import Change, Explanation
    from stixel_cli.results.lineage import Lineage
    from stixel_cli.sweeps.graphs import SweepPlan
    from stixel_cli.sweeps.runs import PlannedRun

MOST_LINES = 30
"""Lines of a module's difference that are printed; --json gives all."""


def explain(
    what: Annotated[
        list[str] | None,
        argument("A result folder, or overrides.", "FOLDER|OVERRIDES", complete_run_or_override),
    ] = None,
    file: FromFile = None,
    trust_code: TrustCode = False,
    json: Json = False,
    config_dir: ConfigDir = None,
) -> int:
    """Explain why results would be recomputed.

    For each missing node, the reason is one of: new, setting, function, version, evicted, input.
    The nodes of a sweep (several values, a file, or a sweep's folder) are listed once, with the
    runs that need them. Pictures are included as in `stixel plan`.

    \b
    Examples:
      stixel explain tracker.length_scale=0.5
      stixel explain tracker.length_scale=0.5,0.6 seed=0,1
      stixel explain results/contour
    """
    from stixel_cli.engine.explain import by_stage
    from stixel_cli.engine.explain import explain as explain_nodes
    from stixel_cli.engine.store import open_store

    plan, lineages = _asked(what or [], file, trust_code)
    targets = list(dict.fromkeys(target for run in plan.runs for target in run.targets))
    store = open_store(plan.runs[0].composition.configuration.cache)
    missing = explain_nodes(plan.graph, store, targets, _before(lineages))
    is_sweep = len(plan.runs) > 1
    needed_by = _needed_by(plan.runs, {node.key for node in missing}) if is_sweep else {}
    if json:
        print_json([_as_json(node, needed_by.get(node.key)) for node in missing])
        return 0
    shown: set[tuple[str, ...]] = set()
    for group, text in by_stage(missing):
        first, last = group[0].label, group[-1].label
        labels = first if first == last else f"{first} … {last}"
        labels += f", {len(group)} nodes" if len(group) > 1 else ""
        runs = sorted({index for node in group for index in needed_by.get(node.key, ())})
        where = f" ({shown_runs(runs, len(plan.runs))})" if is_sweep else ""
        say(f"{labels}{where}: {text}")
        for change in group[0].changes:
            if change.difference and change.difference not in shown:
                shown.add(change.difference)
                say(*(f"    {line}" for line in _shortened(change)))
    if not missing:
        current = _before(lineages)[0] <= plan.graph.nodes.keys()
        other = "" if current else "; the folder has results of other code or files"
        say(f"nothing to recompute: all results are cached{other}")
    return 0


def _before(lineages: "Sequence[Lineage | None]") -> tuple[set[str], dict[str, str]]:
    """The keys of all results of a folder, and the digests of their modules."""
    known = [lineage for lineage in lineages if lineage is not None]
    keys = {key for lineage in known for stage in lineage.stages.values() for key in stage.keys}
    return keys, {name: code for lineage in known for name, code in (lineage.code or {}).items()}


def _shortened(change: "Change") -> list[str]:
    """The first lines of a module's difference, without its two lines of header."""
    lines = list(change.difference[2:])
    if len(lines) > MOST_LINES:
        return [*lines[:MOST_LINES], f"… {len(lines) - MOST_LINES} more lines"]
    return lines


def _asked(
    what: Sequence[str], file: str | None, trust_code: bool
) -> "tuple[SweepPlan, Sequence[Lineage | None]]":
    """The plan of the nodes to explain; the lineages of the runs in the folder to compare with."""
    from stixel_cli.experiment.run import has_pictures, read_stored_run
    from stixel_cli.results.lineage import read_lineage
    from stixel_cli.results.reader import SWEEP_FILE
    from stixel_cli.sweeps.folder import SweepFolder
    from stixel_cli.sweeps.graphs import planned_run, planned_sweep
    from stixel_cli.sweeps.runs import design_runs, sweep_design
    from stixel_cli.sweeps.whole import stored_runs

    folders = [text for text in what if "=" not in text and os.path.isdir(text)]
    if folders and len(what) > 1:
        raise UserError(f"{folders[0]}: name either one result folder or overrides")
    if folders and file is not None:
        raise UserError(f"{folders[0]}: name either a result folder or --from FILE")
    if folders and (Path(folders[0]) / SWEEP_FILE).exists():
        folder = Path(folders[0])
        request = SweepFolder(folder).request()
        plan = planned_sweep(stored_runs(request), None, request.pictures, request.nodes)
        return plan, [read_lineage(run) for run in folder.glob("runs/*")]
    if folders:
        stored = read_stored_run(Path(folders[0]))
        return planned_run(stored.composition, has_pictures(stored)), [stored.lineage]
    lost = [text for text in what if "=" not in text and os.sep in text]
    if lost:
        raise UserError(f"{printable_path(lost[0])}: no such folder")
    design = sweep_design(what, file, one_is_enough=True, trust_code=trust_code)
    runs = design_runs(design)
    if not design.axes:
        return planned_run(runs[0].composition), ()
    return planned_sweep(runs, None, False), ()


def _needed_by(runs: "Sequence[PlannedRun]", missing: set[str]) -> dict[str, list[int]]:
    """Indices of the runs that need each missing node."""
    needed: dict[str, list[int]] = {}
    for run in runs:
        reached: set[str] = set()
        pending = [key for key in run.targets if key in missing]
        while pending:
            key = pending.pop()
            if key not in reached:
                reached.add(key)
                # The sources of a cached node are not needed, missing or not.
                pending += [s for s in run.graph.nodes[key].sources if s in missing]
        for key in reached:
            needed.setdefault(key, []).append(run.index)
    return needed


def shown_runs(runs: Sequence[int], count: int) -> str:
    """Indices in ascending order, as `runs 0-4, 7`; `all 8 runs` for all of them."""
    if len(runs) == count:
        return f"all {count} runs"
    # Consecutive numbers differ from their positions by the same amount.
    ranges = [list(part) for _, part in groupby(enumerate(runs), lambda at: at[1] - at[0])]
    ends = [(part[0][1], part[-1][1]) for part in ranges]
    shown = ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in ends)
    return f"run{'' if len(runs) == 1 else 's'} {shown}"


def _as_json(node: "Explanation", runs: Sequence[int] | None) -> dict:
    return {
        "key": node.key,
        "stage": node.stage,
        "node": node.label,
        **({} if runs is None else {"runs": sorted(runs)}),
        "why": [vars(change) | {"text": str(change)} for change in node.changes],
    }
