"""A small project of its own for each test: real stages in a real package on the disk."""

import importlib
import itertools
import sys
import time
from pathlib import Path
from textwrap import dedent

import pytest
from executors import executors

from stixel_cli.engine import loaded_code
from stixel_cli.engine.execute import execute
from stixel_cli.engine.graph import GraphBuilder
from stixel_cli.engine.keys import Stage
from stixel_cli.engine.progress import Progress
from stixel_cli.engine.store import VALUE, Store

FRAMES, CHUNK = 10, 4

MODULES = {
    "__init__": "",
    "nouns": """
        from dataclasses import dataclass
        import numpy as np

        @dataclass(frozen=True)
        class Chunk:
            first: int
            values: np.ndarray

            def total(self):
                return float(self.values.sum())

        @dataclass(frozen=True)
        class Gain:
            factor: float
            offset: float
        """,
    "helpers": """
        FACTOR = 3.0
        UNUSED = 1.0

        def scale(values):
            # a comment
            return FACTOR * values

        def unused(values):
            return UNUSED * values
        """,
    "log": """
        import os

        def called(name):
            with open(os.environ["CALLS"], "a") as file:
                file.write(name + "\\n")
        """,
    "numbers": """
        import numpy as np

        from . import log

        def numbers(count):
            log.called("numbers")
            return np.arange(count, dtype=np.float64)
        """,
    "double": """
        from . import log
        from .helpers import scale
        from .nouns import Chunk, Gain

        def double(numbers, gain: Gain, frames):
            \"\"\"A docstring.\"\"\"
            log.called(f"double {frames.start}")
            values = numbers[frames.start:frames.stop]
            return Chunk(frames.start, gain.factor * scale(values) + gain.offset)
        """,
    "running": """
        from . import log

        def running(doubled, frames, previous):
            log.called(f"running {frames.start}")
            return doubled.total() + (0.0 if previous is None else previous)
        """,
    "gather": """
        import numpy as np

        from . import log

        def gather(doubled, running, seed):
            log.called("gather")
            noise = np.random.default_rng(seed).normal(size=3)
            return [chunk.total() for chunk in doubled], list(running), noise
        """,
    "show": """
        from . import log

        def show(doubled, grid, frame):
            log.called(f"show {frame}")
            return doubled.first, grid, frame
        """,
    "grid": """
        from . import log

        def grid(doubled, frame):
            log.called(f"grid {frame}")
            return float(doubled.values[frame - doubled.first])
        """,
}


def pytest_itemcollected(item):
    """The engine is tested with its worker processes."""
    item.add_marker("workers")


_numbers = itertools.count()


class Notes(Progress):
    """Keeps the notes instead of printing them."""

    def __init__(self):
        super().__init__()
        self.notes = []

    def note(self, text):
        self.notes.append(text)


class Project:
    """A package in a folder, its stages, a store, and the calls that were made."""

    def __init__(self, folder: Path):
        self.name = f"project{next(_numbers)}"
        self.folder = folder
        self.package = folder / self.name
        self.package.mkdir()
        self.calls_file = folder / "calls"
        self.store = Store(folder / "cache")
        for module, text in MODULES.items():
            self.write(module, text)

    def write(self, module: str, text: str) -> None:
        (self.package / f"{module}.py").write_text(dedent(text))

    def edit(self, module: str, old: str, new: str) -> None:
        path = self.package / f"{module}.py"
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    def add_line(self, function: str, line: str) -> None:
        """Put a line at the beginning of a stage's body."""
        call = f'log.called("{function}")'
        self.edit(function, call, f"{call}; {line}")

    def contents(self, graph) -> dict[str, bytes]:
        """The stored bytes of every node that is there."""
        keys = {node.label: key for key, node in graph.nodes.items() if self.store.has(key)}
        return {label: (self.store.entry(key) / VALUE).read_bytes() for label, key in keys.items()}

    def forget(self) -> None:
        """Forget the imported package, so that it is imported again as in a new process."""
        for name in list(sys.modules):
            if name.partition(".")[0] == self.name:
                del sys.modules[name]
        importlib.invalidate_caches()
        loaded_code._imported.clear()
        loaded_code._started = time.time()

    def calls(self) -> list[str]:
        """The calls since the last time this was asked, in sorted order."""
        text = self.calls_file.read_text() if self.calls_file.exists() else ""
        self.calls_file.unlink(missing_ok=True)
        return sorted(text.split("\n")[:-1])

    def function(self, name: str, module: str | None = None) -> str:
        """A stage's function; each stage is in a module of its own name."""
        return f"{self.name}.{module or name}:{name}"

    def stages(self, factor=2.0, offset=0.0, seed=1, frames=(2, 9), count=FRAMES) -> list[Stage]:
        gain = importlib.import_module(f"{self.name}.nouns").Gain(factor, offset)
        doubled = {"doubled": "double"}

        def stage(name, pattern, inputs, settings=None, **more):
            return Stage(name, self.function(name), pattern, inputs, settings or {}, **more)

        return [
            stage("numbers", "once", {}, {"count": count}),
            stage("double", "map", {"numbers": "numbers"}, {"gain": gain}),
            stage("running", "fold", doubled),
            stage("gather", "once", doubled | {"running": "running"}, seed=seed),
            stage("grid", "pick", doubled, frames=frames),
            stage("show", "pick", doubled | {"grid": "grid"}, frames=frames),
        ]

    def graph(self, **changes):
        return GraphBuilder().build(self.stages(**changes), FRAMES, CHUNK)

    def run(self, graph=None, targets=("gather", "show"), executor="serial", workers=2, **options):
        """Execute, by default in this process, with the code as it is on the disk."""
        self.forget()
        graph = self.graph() if graph is None else graph
        if isinstance(executor, str):
            executor = executors(workers)[executor]
        return execute(graph, targets, self.store, executor=executor, **options)


@pytest.fixture
def notes():
    return Notes()


@pytest.fixture
def project(tmp_path, monkeypatch):
    project = Project(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("CALLS", str(project.calls_file))
    # Edits within one second would meet the bytecode of the text before.
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield project
    project.forget()
