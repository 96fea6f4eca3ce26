"""What decides a node's result, gathered into the node's key."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import file_digest
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from stixel_cli.engine.canonical import canonical, digest, settings_types
from stixel_cli.engine.code_hash import CodeHash, CodeIndex
from stixel_cli.engine.stage import Stage

LAYOUT = 2
"""Goes up when entries are stored in another way, so that older ones are not read."""


@dataclass(frozen=True)
class Identity:
    """What all nodes of a stage have in common in their keys.

    Attributes:
        code: the code that the stage reaches.
        types: the settings' classes whose code counts, as (module, qualified name).
        content: stage, function, settings, code, versions, seed and files as a JSON tree.
        digest: of `content`.
    """

    code: CodeHash
    types: tuple[tuple[str, str], ...]
    content: dict[str, Any]
    digest: str


def stage_identity(stage: Stage, index: CodeIndex) -> Identity:
    """The part of the key that does not change from node to node of a stage.

    Raises:
        LookupError: there is no such function.
        TypeError: a setting that cannot be part of a key.
        OSError: one of the stage's files cannot be read.
    """
    package = stage.function.partition(".")[0].partition(":")[0]
    types = tuple(
        sorted(
            (kind.__module__, kind.__qualname__)
            for kind in settings_types(dict(stage.settings))
            if kind.__module__.partition(".")[0] == package
        )
    )
    code = index.hash(stage.function, types)
    content = {
        "layout": LAYOUT,
        "stage": stage.name,
        "function": stage.function,
        "pattern": stage.pattern,
        "settings": {name: canonical(stage.settings[name]) for name in sorted(stage.settings)},
        "code": code.digest,
        "python": python_version(),
        "versions": {name: installed_version(name) for name in sorted(stage.packages)},
        "seed": stage.seed,
        "files": [_content_digest(path) for path in stage.files],
    }
    return Identity(code, types, content, digest(content))


def node_key(
    identity: Identity,
    first: int | None,
    stop: int | None,
    inputs: Mapping[str, tuple[str, ...]],
    previous: str | None,
) -> str:
    """Key of one node: 64 hex digits.

    `first` and `stop` bound its frames (None for `once`); `inputs` are the keys of the nodes that
    give each argument, and `previous` the key of the fold's node before.
    """
    return digest(
        {
            "identity": identity.digest,
            "frames": [first, stop],
            "inputs": {name: list(keys) for name, keys in inputs.items()},
            "previous": previous,
        }
    )


def python_version() -> str:
    """As it counts in keys: without the last part."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


@cache
def installed_version(name: str) -> str | None:
    """Version of a distribution, None if it is not installed. Looked up once a process."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _content_digest(path: Path) -> str:
    with Path(path).open("rb") as file:
        return file_digest(file, "sha256").hexdigest()
