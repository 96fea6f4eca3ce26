"""A stage: a function with its name, inputs and settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

Pattern = Literal["once", "map", "fold", "pick"]

CHUNKED = ("map", "fold")
"""Patterns with one node per chunk of frames."""

GIVEN = {
    "once": (),
    "map": ("frames",),
    "fold": ("frames", "previous"),
    "pick": ("frame",),
}
"""Arguments that the engine adds, by pattern."""


@dataclass(frozen=True)
class Stage:
    """A function with its name, inputs and settings.

    Attributes:
        name: unique in its graph.
        function: "package.module:function", imported only where it runs.
        pattern: `once` is one node. `map` is one node per chunk of frames, called with
            `frames: range`. `fold` is `map` with `previous`, its own result of the chunk before
            (None for the first). `pick` is one node per chosen frame, called with `frame: int`.
        inputs: argument name -> name of the stage that provides it. A chunked input is passed to a
            chunked stage as the chunk of the same frames, to `pick` as the chunk that contains the
            frame, and to `once` as a lazy sequence of all chunks.
        settings: argument name -> slice of the configuration, a frozen dataclass or plain value.
        modules: further modules whose code is part of the key: those that no import statement of
            the function's module leads to.
        seed: passed as `seed` and part of the key; None for a stage that draws no random numbers.
        frames: the chosen frames of a `pick` stage.
        files: external files; the digest of their content is part of the key.
        keys: argument name -> key of the setting in the configuration, if it differs from the
            argument. Used to explain changes; not part of the result's key.
    """

    name: str
    function: str
    pattern: Pattern
    inputs: Mapping[str, str]
    settings: Mapping[str, Any]
    modules: tuple[str, ...] = ()
    seed: int | None = None
    frames: tuple[int, ...] = ()
    files: tuple[Path, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)

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
        for argument in (*self.inputs, *self.settings):
            if argument in given or (argument in self.inputs and argument in self.settings):
                raise ValueError(f"stage {self.name}: argument {argument!r} is given twice")
        if self.frames and self.pattern != "pick":
            raise ValueError(f"stage {self.name}: frames are for the pattern pick")
