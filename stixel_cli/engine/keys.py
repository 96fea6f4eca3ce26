"""What decides a node's result, gathered into the node's key."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Any

from stixel_cli.engine.canonical import canonical, digest, settings_types
from stixel_cli.engine.code import Code, CodeIndex
from stixel_cli.engine.stage import Stage

LAYOUT = 3
"""Goes up when entries are stored in another way, so that older ones are not read."""


@dataclass(frozen=True)
class Identity:
    """What all nodes of a stage have in common in their keys.

    Attributes:
        code: the code that the stage reaches.
        content: stage, function, settings, code, versions, seed and files as a JSON tree.
        digest: of `content`.
    """

    code: Code
    content: dict[str, Any]
    digest: str


def stage_identity(stage: Stage, index: CodeIndex) -> Identity:
    """The part of the key that does not change from node to node of a stage.

    Raises:
        LookupError: there is no such module, or one that is not Python.
        TypeError: a setting that cannot be part of a key.
        OSError: one of the stage's files cannot be read.
    """
    types = settings_types(dict(stage.settings))
    module = stage.function.partition(":")[0]
    code = index.code({module, *stage.modules, *(kind.__module__ for kind in types)})
    content = {
        "layout": LAYOUT,
        "stage": stage.name,
        "function": stage.function,
        "pattern": stage.pattern,
        "settings": {name: canonical(stage.settings[name]) for name in sorted(stage.settings)},
        "code": code.digest,
        "python": python_version(),
        "versions": code.versions,
        "seed": stage.seed,
        "files": [_content_digest(path) for path in stage.files],
    }
    return Identity(code, content, digest(content))


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


def _content_digest(path: Path) -> str:
    with Path(path).open("rb") as file:
        return file_digest(file, "sha256").hexdigest()
