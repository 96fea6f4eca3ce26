"""What all exports share: results of stages, and a new folder."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stixel_cli.engine.execute import execute
from stixel_cli.engine.locks import lease
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import open_store
from stixel_cli.errors import UserError
from stixel_cli.experiment.run import experiment_graph, one_line_errors
from stixel_cli.files import written
from stixel_cli.results.folder import whole_folder
from stixel_cli.results.result import RunResult


@contextmanager
def stage_results(
    stored: RunResult, wanted: Sequence[str], what: str, progress: Progress | None
) -> Iterator[dict[str, list[Any]]]:
    """The results of stages by name, each a list with one result for each chunk of frames.

    Results that the cache lacks are computed. `what` names them, for messages.

    Raises:
        UserError: if the run has no such stage.
        StageFailure: if a stage fails.
    """
    configuration = stored.composition.configuration
    store = open_store(configuration.cache)
    with one_line_errors():
        graph = experiment_graph(stored.composition)
        if not all(name in graph.stages for name in wanted):
            raise UserError(f"{stored.folder}: has no {what} to export")
        with lease(store.folder, sorted(graph.ancestors(graph.expand(wanted)))):
            execute(graph, wanted, store, executor=configuration.executor, progress=progress)
            yield {name: [store.load(node.key) for node in graph.of_stage(name)] for name in wanted}


def write_texts(folder: Path, texts: Mapping[str, str]) -> list[str]:
    """Write files by name as a new folder, and return their names; errors as `write_new_folder`."""

    def write(partial: Path) -> None:
        for name, text in texts.items():
            (partial / name).write_text(text, encoding="utf-8")

    write_new_folder(folder, write)
    return list(texts)


def write_new_folder(folder: Path, write: Callable[[Path], None]) -> None:
    """Write a new folder: it appears complete, or not at all.

    Raises:
        UserError: if it exists, or cannot be written.
    """
    if os.path.lexists(folder):
        raise UserError(f"--output: {folder} exists; choose another folder")
    with written(folder), whole_folder(folder) as partial:
        write(partial)
