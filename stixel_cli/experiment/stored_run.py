"""A result folder as an experiment that can be run again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli import __version__
from stixel_cli.config.compose import Composition, compose, from_resolved
from stixel_cli.errors import ConfigurationError, UserError
from stixel_cli.results.lineage import Lineage, read_lineage
from stixel_cli.results.reader import check_folder, read_config, read_manifest, read_metrics

OF_THE_MACHINE = ("executor", "cache")
"""Groups that say where to compute, not what: a rerun takes those of the machine it runs on."""


@dataclass(frozen=True)
class StoredRun:
    """What a result folder says of its run.

    Attributes:
        path: the folder.
        composition: its configuration, validated, with the machine's own executor and cache.
        manifest, metrics: what the files of these names hold.
        lineage: what the stages were made of; None in a folder of an older version.
    """

    path: Path
    composition: Composition
    manifest: dict[str, Any]
    metrics: dict[str, float | int | None]
    lineage: Lineage | None

    @property
    def pictures(self) -> bool:
        """Whether it has pictures: those of a sweep's points have none, unless asked for."""
        return (self.path / "figures").is_dir()


def read_stored_run(path: Path, overrides: tuple[str, ...] = ()) -> StoredRun:
    """Read the result folder `path`; `overrides` are of the groups `OF_THE_MACHINE` alone.

    Raises:
        UserError: if it is no result folder, or its configuration is not one of this version.
    """
    check_folder(path)
    manifest = read_manifest(path)
    own = compose(overrides).resolved
    resolved = read_config(path) | {name: own[name] for name in OF_THE_MACHINE if name in own}
    try:
        configuration = from_resolved(resolved)
    except ConfigurationError as fault:
        raise UserError(f"{path / 'config.yaml'}: {fault}{_by_another_version(manifest)}") from None
    choices = manifest.get("choices")
    given = manifest.get("overrides")
    composition = Composition(
        configuration,
        {str(k): str(v) for k, v in choices.items()} if isinstance(choices, dict) else {},
        tuple(str(text) for text in given) if isinstance(given, list) else (),
        resolved,
    )
    return StoredRun(path, composition, manifest, read_metrics(path), read_lineage(path))


def _by_another_version(manifest: dict[str, Any]) -> str:
    versions = manifest.get("versions")
    theirs = versions.get("stixel") if isinstance(versions, dict) else None
    if theirs in (None, __version__):
        return ""
    return f" (the folder was made by stixel {theirs}, this is {__version__})"
