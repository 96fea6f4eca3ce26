"""What all exports share: results of stages, and a new folder."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stixel_cli.engine.progress import Progress
from stixel_cli.errors import UserError
from stixel_cli.experiment.stages import computed_stages, pipeline_stages
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
    if not set(wanted) <= {stage.name for stage in pipeline_stages(stored.composition)}:
        raise UserError(f"{stored.folder}: has no {what} to export")
    with computed_stages(stored.composition, wanted, progress) as (_, load):
        yield {name: load(name) for name in wanted}


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Context with a partial folder, which at the end becomes `folder`: complete, or not at all.

    Raises:
        UserError: if `folder` exists, or cannot be written.
    """
    if os.path.lexists(folder):
        raise UserError(f"--output: {folder} exists; choose another folder")
    with whole_folder(folder) as partial:
        yield partial
