"""The source that differs between two runs, as far as the cache keeps a copy of it."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stixel_cli.engine.source_files import kept_source
from stixel_cli.results.lineage import read_lineage
from stixel_cli.results.reader import read_manifest


@dataclass(frozen=True)
class ModuleDifference:
    """A module whose code differs.

    Attributes:
        module: its name.
        lines: of the unified difference; empty if a source is not known.
        reason: why there are no lines; "" otherwise.
    """

    module: str
    lines: tuple[str, ...]
    reason: str


def code_differences(
    one: Path, other: Path, labels: tuple[str, str], store_folder: Path
) -> list[ModuleDifference]:
    """The modules of two runs whose code differs, by name; `labels` are the runs' names.

    Raises:
        UserError: if a file of a folder is not valid.
    """
    codes = []
    for folder, label in zip((one, other), labels, strict=True):
        lineage = read_lineage(folder)
        if lineage is None or lineage.code is None:
            return [ModuleDifference("", (), f"{label}: the folder does not record its code")]
        codes.append(lineage.code)
    before, after = codes
    how = _with_git(read_manifest(one), read_manifest(other))
    found = []
    for module in sorted({*before, *after}):
        digests = [code.get(module) for code in codes]
        if digests[0] == digests[1]:
            continue
        sources = [None if d is None else kept_source(store_folder, d) for d in digests]
        missing = [
            label
            for label, digest, source in zip(labels, digests, sources, strict=True)
            if digest is not None and source is None
        ]
        if missing:
            reason = f"the cache has no copy of the source of {' and '.join(missing)}{how}"
            found.append(ModuleDifference(module, (), reason))
            continue
        names = [f"{label}: {module}" for label in labels]
        texts = [source or [] for source in sources]
        lines = difflib.unified_diff(*texts, *names, lineterm="", n=2)
        found.append(ModuleDifference(module, tuple(lines), ""))
    return found


def _with_git(*manifests: Mapping[str, Any]) -> str:
    """How git shows the difference, if both runs are of revisions without changes."""
    states = [manifest.get("git") for manifest in manifests]
    if not all(isinstance(git, dict) and git.get("revision") for git in states):
        return ""
    if any(git.get("dirty") is not False for git in states):
        return ""
    revisions = [str(git["revision"])[:12] for git in states]
    return f"; try: git diff {' '.join(revisions)}" if len(set(revisions)) > 1 else ""
