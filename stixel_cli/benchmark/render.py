"""Render sequences: with the cached graph of a sweep, so that it resumes and uses any workers."""

from collections.abc import Callable, Sequence
from pathlib import Path

from stixel_cli.benchmark.data import (
    MANIFEST,
    RENDERED,
    manifest_text,
    sequence_files,
    write_sequence,
)
from stixel_cli.benchmark.sequences import Sequence as Frozen
from stixel_cli.benchmark.sequences import planned
from stixel_cli.engine.cache_folder import Lease
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import merge
from stixel_cli.engine.progress import make_progress
from stixel_cli.engine.store import open_store
from stixel_cli.files import write_whole, written
from stixel_cli.results.folder import json_text
from stixel_cli.results.lineage import provenance
from stixel_cli.sweeps.graphs import plan_runs

NODES = ("scenario", "scans", "start")
BATCH = 6
"""Sequences that are computed together: the images of more would fill the cache."""


def render(
    chosen: Sequence[Frozen], folder: Path, workers: int | None, note: Callable[[str], None]
) -> str:
    """Write sequences and their manifest; return the text of the manifest.

    What the cache has is not computed again. The manifest is written last: a folder without one is
    not complete.

    Args:
        chosen: the sequences.
        folder: to write to; files of the same sequences are replaced.
        workers: number of processes; None for that of the configuration.
        note: called with one line after each batch.
    """
    further = {} if workers is None else {"executor.workers": workers}
    runs = planned(chosen, further)
    files: dict[str, str] = {}
    with written(folder):
        (folder / MANIFEST).unlink(missing_ok=True)
    for first in range(0, len(chosen), BATCH):
        batch = chosen[first : first + BATCH]
        own = plan_runs(runs[first : first + BATCH], nodes=NODES)
        configuration = own[0].composition.configuration
        store, graph = open_store(configuration.cache), merge(run.graph for run in own)
        targets = [key for run in own for key in run.graph.expand(NODES)]
        with Lease(store.folder, targets):
            execute(graph, targets, store, configuration.executor, make_progress())
            for sequence, run in zip(batch, own, strict=True):
                scenario, scans, start = map(store.load, run.graph.expand(NODES))
                prior = run.composition.configuration.prior
                content = sequence_files(scans, start, prior, scenario)
                digests = write_sequence(folder / sequence.name, content)
                files |= {f"{sequence.name}/{name}": one for name, one in digests.items()}
        note(f"{first + len(batch)} of {len(chosen)} sequences")
    text = manifest_text(files)
    with written(folder):
        write_whole(folder / RENDERED, json_text(provenance()))
        write_whole(folder / MANIFEST, text)
    return text
