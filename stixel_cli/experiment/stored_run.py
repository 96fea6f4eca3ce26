"""Read a result folder as an experiment that can be run again."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from stixel_cli import __version__
from stixel_cli.config.compose import Composition, compose, from_resolved
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.results.lineage import read_lineage
from stixel_cli.results.result import RunResult, read_run

OF_THE_MACHINE = ("executor", "cache")
"""Groups that name where to compute, not what: a rerun uses those of its own machine."""


def read_stored_run(path: Path, overrides: tuple[str, ...] = ()) -> RunResult:
    """Read the result folder `path`, with its validated experiment and its lineage.

    The experiment has the executor and the cache of this machine. `overrides` may only change the
    groups `OF_THE_MACHINE`.

    Raises:
        UserError: if it is not a result folder, or its configuration is not valid in this version.
    """
    run = read_run(path)
    own = compose(overrides).resolved
    resolved = {**run.settings, **{name: own[name] for name in OF_THE_MACHINE if name in own}}
    try:
        configuration = from_resolved(resolved)
    except ConfigurationError as fault:
        raise UserError(
            f"{path / 'config.yaml'}: {fault}{_by_another_version(run.manifest)}"
        ) from None
    choices = run.manifest.get("choices")
    given = run.manifest.get("overrides")
    composition = Composition(
        configuration,
        {str(k): str(v) for k, v in choices.items()} if isinstance(choices, dict) else {},
        tuple(str(text) for text in given) if isinstance(given, list) else (),
        resolved,
    )
    return replace(run, settings=resolved, composition=composition, lineage=read_lineage(path))


def has_pictures(run: RunResult) -> bool:
    """Whether the folder of a run has pictures. Runs of a sweep have them only on request."""
    return (run.folder / "figures").is_dir()


def _by_another_version(manifest: Mapping[str, Any]) -> str:
    versions = manifest.get("versions")
    theirs = versions.get("stixel") if isinstance(versions, dict) else None
    if theirs in (None, __version__):
        return ""
    return f" (the folder was made by stixel {theirs}, this is {__version__})"
