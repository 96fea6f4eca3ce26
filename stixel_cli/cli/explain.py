"""`stixel explain`: why a run would compute what it would."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from stixel_cli.config.compose import Composition, compose
from stixel_cli.engine.explain import Explanation, by_stage, explain
from stixel_cli.engine.store import open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.recorded_run import told_in_one_line
from stixel_cli.experiment.run import experiment_graph, targets
from stixel_cli.experiment.stored_run import read_stored_run
from stixel_cli.experiment.text import json_text


def explain_command(what: Sequence[str], json: bool) -> int:
    """Print why each node of a run would be computed; the exit code.

    `what` is one result folder, or overrides.

    Raises:
        UserError: for what `stixel run` would refuse.
    """
    composition = _composition(what)
    with told_in_one_line():
        graph = experiment_graph(composition.configuration)
        store = open_store(composition.configuration.cache)
        found = explain(graph, store, targets(graph))
    if json:
        sys.stdout.write(json_text([_as_json(one) for one in found]))
        return 0
    for group, text in by_stage(found):
        first, last = group[0].label, group[-1].label
        labels = first if len(group) == 1 else f"{first} … {last}, {len(group)} nodes"
        sys.stdout.write(f"{labels}: {text}\n")
    if not found:
        sys.stdout.write("nothing would run: all is cached\n")
    return 0


def _composition(what: Sequence[str]) -> Composition:
    if len(what) == 1 and os.path.isdir(what[0]):
        return read_stored_run(Path(what[0])).composition
    folders = [text for text in what if "=" not in text and os.path.isdir(text)]
    if folders:
        raise UserError(f"{folders[0]}: name one result folder, or overrides, not both")
    lost = [text for text in what if "=" not in text and os.sep in text]
    if lost:
        raise UserError(f"{lost[0]}: there is no such folder")
    return compose(what)


def _as_json(one: Explanation) -> dict:
    return {
        "key": one.key,
        "stage": one.stage,
        "node": one.label,
        "why": [
            {"kind": c.kind, "what": c.what, "before": c.before, "after": c.after, "text": str(c)}
            for c in (*one.changes, *one.roots)
        ],
    }
