"""A stage: one step of a pipeline, named and bound to its slice of the configuration."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

Pattern = Literal["once", "map", "fold", "pick"]

CHUNKED = ("map", "fold")
"""The patterns that have one node for every chunk of frames."""

GIVEN = {
    "once": (),
    "map": ("frames",),
    "fold": ("frames", "previous"),
    "pick": ("frame",),
}
"""Arguments the engine gives of its own accord, for each pattern."""


@dataclass(frozen=True)
class Stage:
    """One step of a pipeline.

    Attributes:
        name: unique in its pipeline.
        function: "package.module:function", imported only where it runs.
        pattern: `once` is one node; `map` one node for every chunk of frames, called with
            `frames: range`; `fold` the same with `previous`, its own result of the chunk before
            (None at the first); `pick` one node for every chosen frame, called with `frame: int`.
        inputs: argument name -> name of the stage that gives it. A chunked input arrives in a
            chunked stage as the chunk with the same frames, in `pick` as the chunk that holds
            the frame, and in `once` as a lazy sequence of all chunks.
        settings: argument name -> slice of the configuration, a frozen dataclass or plain value.
        modules: further modules whose code is part of the key: those that no import statement of
            the function's module leads to.
        seed: given as `seed` and part of the key; None for a stage that draws nothing.
        frames: the chosen frames of a `pick` stage.
        files: outside files; the digest of their content is part of the key.
        keys: argument name -> what its setting is called where the user sets it, if otherwise
            than the argument; to tell what changed, and no part of the key.
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
        """Raise ValueError, in one line, if the stage contradicts itself."""
        if self.pattern not in GIVEN:
            raise ValueError(
                f"stage {self.name}: no pattern {self.pattern!r}, only {', '.join(GIVEN)}"
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
