"""Render sequences: with the cached graph of a sweep, so that it resumes and uses any workers."""

import json
from collections.abc import Callable
from pathlib import Path

from stixel_cli.benchmark.data import MANIFEST, RENDERED, SequenceData, sha256
from stixel_cli.benchmark.sequences import Sequence, definitions, planned
from stixel_cli.border import write_whole, written
from stixel_cli.engine.cache_folder import Lease
from stixel_cli.engine.execute import execute
from stixel_cli.engine.progress import Progress
from stixel_cli.results.folder import json_text
from stixel_cli.results.lineage import provenance
from stixel_cli.sweeps.graphs import plan_runs

NODES = ("scenario", "scans", "start")
BATCH = 6
"""Sequences that are computed together: the images of more would fill the cache."""


def render(
    chosen: list[Sequence], folder: Path, workers: int | None, note: Callable[[str], None]
) -> None:
    """Write sequences into a folder, and last their manifest; `note` gets a line for each batch.

    What the cache has is not computed again. The manifest's own SHA-256 is the id, so it has
    nothing that differs between two renderings.
    """
    runs = planned(chosen, {} if workers is None else {"executor.workers": workers})
    digests: dict[str, str] = {}
    with written(folder):
        (folder / MANIFEST).unlink(missing_ok=True)
        for first in range(0, len(chosen), BATCH):
            batch = slice(first, first + BATCH)
            plan = plan_runs(runs[batch], nodes=NODES)
            own, store = plan.runs, plan.store
            targets = [key for run in own for key in run.graph.expand(NODES)]
            with Lease(store.folder, targets):
                execute(plan.graph, targets, store, plan.executor, Progress(visible=True))
                for sequence, run in zip(chosen[batch], own, strict=True):
                    truth, scans, start = map(store.load, run.graph.expand(NODES))
                    prior = run.composition.configuration.prior
                    for name, content in SequenceData(scans, start, prior, truth).files().items():
                        write_whole(folder / sequence.name / name, content)
                        digests[f"{sequence.name}/{name}"] = sha256(content)
            note(f"{first + len(own)} of {len(chosen)} sequences")
        content = {"benchmark": definitions()["version"], "files": dict(sorted(digests.items()))}
        write_whole(folder / RENDERED, json_text(provenance()))
        write_whole(folder / MANIFEST, json.dumps(content, indent=1) + "\n")
