"""A stage, and the key of its results: a digest of everything that determines them."""

import json
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

from stixel_cli.border.files import GREATEST_RECORDING, known_digest
from stixel_cli.engine.code import Code, CodeIndex
from stixel_cli.engine.versions import python_version

Pattern = Literal["once", "map", "fold", "pick"]

CHUNKED = ("map", "fold")
"""Patterns with one node per chunk of frames."""

GIVEN = {"once": (), "map": ("frames",), "fold": ("frames", "previous"), "pick": ("frame",)}
"""Arguments that the engine adds, by pattern."""


@dataclass(frozen=True)
class Stage:
    """A function with its name, inputs and settings."""

    name: str
    """Unique in its graph."""
    function: str
    """As "package.module:function"; imported only where it runs."""
    pattern: Pattern
    """`once` is one node. `map` is one node per chunk of frames, called with `frames: range`.
    `fold` is `map` with `previous`, its own result of the chunk before (None for the first). `pick`
    is one node per chosen frame, called with `frame: int`."""
    inputs: Mapping[str, str]
    """Argument name -> name of the stage that provides it. A chunked input is passed to a chunked
    stage as the chunk of the same frames, to `pick` as the chunk that contains the frame, and to
    `once` as a lazy sequence of all chunks."""
    settings: Mapping[str, Any]
    """Argument name -> slice of the configuration, a frozen dataclass or plain value."""
    modules: tuple[str, ...] = ()
    """Further modules whose code is part of the key: those that no import statement of the
    function's module leads to."""
    seed: int | None = None
    """Passed as `seed` and part of the key; None for a stage that draws no random numbers."""
    frames: tuple[int, ...] = ()
    """The chosen frames of a `pick` stage."""
    files: tuple[Path, ...] = ()
    """External files; the digest of their content is part of the key."""
    gives_files: bool = False
    """Whether `files` is passed as an argument of this name. Their paths are not part of the
    key."""
    folders: tuple[Path, ...] = ()
    """Searched for modules that the import path lacks; not part of the key."""
    own: bool = False
    """Whether `modules` are the user's own code: an error there is reported with its place."""
    keys: Mapping[str, str] = field(default_factory=dict)
    """Argument name -> key of the setting in the configuration, if it differs from the argument.
    Used to explain changes; not part of the result's key."""
    amount: float = 1.0
    """Of work for a frame, or for the one node, such as the megapixels of an image or the number of
    scans. Only for estimates of the time; not part of the key."""

    def check(self) -> None:
        """Raise ValueError, in one line, if the stage is not valid."""
        if self.pattern not in GIVEN:
            raise ValueError(
                f"stage {self.name}: {self.pattern!r} is not a pattern; choose {', '.join(GIVEN)}"
            )
        module, _, function = self.function.partition(":")
        if not module or not function.isidentifier():
            raise ValueError(f"stage {self.name}: {self.function!r} is not package.module:function")
        given = {*GIVEN[self.pattern], *(("seed",) if self.seed is not None else ())}
        given |= {"files"} if self.gives_files else set()
        for argument in (*self.inputs, *self.settings):
            if argument in given or (argument in self.inputs and argument in self.settings):
                raise ValueError(f"stage {self.name}: argument {argument!r} is given twice")
        if self.frames and self.pattern != "pick":
            raise ValueError(f"stage {self.name}: frames are for the pattern pick")


def canonical(value: Any) -> Any:
    """Encode a setting as a JSON tree with types and values, floats to the last bit.

    Dataclasses carry the name of their type. A field with its default value is left out: adding
    such a field keeps the keys. 1, 1.0 and True differ, as do 0.0 and -0.0, and a list and a tuple.
    TypeError for a value of a type that has no canonical form.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return {"float": repr(float(value))}
    if isinstance(value, list | tuple):
        return {type_name(value): [canonical(item) for item in value]}
    if is_dataclass(value) and not isinstance(value, type):
        content = {}
        for one in fields(value):
            tree = canonical(getattr(value, one.name))
            if one.default is MISSING or tree != canonical(one.default):
                content[one.name] = tree
        return {type_name(value): content}
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {"mapping": {key: canonical(value[key]) for key in sorted(value)}}
    raise TypeError(f"a setting of type {type(value).__name__} cannot be part of a key: {value!r}")


Difference = tuple[str, str, str]
"""Dotted path of a setting, old value, new value; "" for a missing value."""


def differences(before: Any, after: Mapping[str, Any], prefix: str = "") -> list[Difference]:
    """List the settings in which two canonical trees differ; their paths begin with `prefix`."""
    before = before if isinstance(before, Mapping) else {}
    found: list[Difference] = []
    for name in sorted({*before, *after}):
        path = prefix + name
        if name not in before:
            found.append((path, "", plain(after[name])))
        elif name not in after:
            found.append((path, plain(before[name]), ""))
        elif before[name] != after[name]:
            (kind, old), (new_kind, new) = _content(before[name]), _content(after[name])
            if kind and kind == new_kind:
                found += differences(old, new, f"{path}.")
            else:
                found.append((path, plain(before[name]), plain(after[name])))
    return found


def _content(tree: Any) -> tuple[str, Mapping[str, Any]]:
    """Type and fields of a dataclass or mapping in canonical form; otherwise "", {}."""
    if isinstance(tree, dict) and len(tree) == 1:
        ((kind, fields),) = tree.items()
        if isinstance(fields, dict):
            return kind, fields
    return "", {}


def plain(tree: Any) -> str:
    """Format a canonical tree as in a configuration file."""
    if tree is None:
        return "null"
    if isinstance(tree, bool):
        return str(tree).lower()
    if isinstance(tree, list):
        return f"[{', '.join(map(plain, tree))}]"
    if isinstance(tree, dict):
        if set(tree) == {"float"}:
            return str(tree["float"])
        ((name, content),) = tree.items()
        if isinstance(content, list):
            return plain(content)
        # A variant of a group by its kind, other values by their class.
        return str(content.get("kind", name.rpartition(".")[2]))
    return str(tree) or "''"


def type_name(value: Any) -> str:
    """Module and name of the type of a value; only the name of a built-in type."""
    kind = type(value)
    module = "" if kind.__module__ == "builtins" else f"{kind.__module__}."
    return f"{module}{kind.__qualname__}"


def settings_types(value: Any) -> set[type]:
    """The dataclasses in `value`, at any depth."""
    kinds: set[type] = set()
    if is_dataclass(value) and not isinstance(value, type):
        kinds, value = {type(value)}, [getattr(value, one.name) for one in fields(value)]
    elif isinstance(value, Mapping):
        value = [*value.values()]
    return kinds.union(*map(settings_types, value if isinstance(value, list | tuple) else ()))


def digest(tree: Any) -> str:
    """SHA-256, in hex, of a JSON tree."""
    text = json.dumps(tree, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return sha256(text.encode()).hexdigest()


LAYOUT = 5
"""Version of the stored format. Entries of other versions are not read."""


@dataclass(frozen=True)
class Identity:
    """The part of the key that all nodes of a stage share."""

    code: Code
    """Code that the stage reaches."""
    content: dict[str, Any]
    """Stage, function, settings, code, versions, seed and files as a JSON tree."""
    digest: str
    """Of `content`."""


def stage_identity(stage: Stage, index: CodeIndex) -> Identity:
    """Compute the identity of a stage.

    LookupError if a module is missing or is not valid Python, TypeError if a setting cannot be part
    of a key, UserError if one of the stage's files cannot be read.
    """
    types = settings_types(dict(stage.settings))
    module = stage.function.partition(":")[0]
    roots = {module, *stage.modules, *(kind.__module__ for kind in types)}
    code = index.code(roots, stage.folders)
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
        # Several stages read a recording, which may be one large file.
        "files": [known_digest(path, GREATEST_RECORDING) for path in stage.files],
    }
    return Identity(code, content, digest(content))


def node_key(
    identity: Identity,
    first: int | None,
    stop: int | None,
    inputs: Mapping[str, tuple[str, ...]],
    previous: str | None,
) -> str:
    """Compute the key of a node with these attributes of `graph.Node`: 64 hex digits."""
    tree = {"identity": identity.digest, "frames": [first, stop], "previous": previous}
    return digest(tree | {"inputs": {name: list(keys) for name, keys in inputs.items()}})
