"""Runs of this process are short: they draw nothing, start no processes and sum up few metrics."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from pkgutil import resolve_name

import pytest

from stixel_cli.answers.runs import SHOWN, Runs
from stixel_cli.evaluation.metric_table import METRICS
from stixel_cli.pictures import style


def _shown_metrics(runs: Runs) -> list[str]:
    """Those of the terminal's table, and what is no metric of stixel; else a few, as there."""
    every = _ALL_METRICS(runs)
    return [name for name in every if name in SHOWN or name not in METRICS] or every[:4]


_ALL_METRICS = Runs.metrics.func
_SHOWN_METRICS = cached_property(_shown_metrics)
_SHOWN_METRICS.__set_name__(Runs, "_shown_metrics")

SHORT = {
    "drawn": {
        "stixel_cli.experiment.run.PICTURES": (),
        "stixel_cli.sweeps.folder.sweep_page": lambda *_, **given: "",
        "stixel_cli.studies.report.study_page": lambda *_: "",
        "stixel_cli.answers.figures.drawing": lambda *_: (b"<svg/>", ""),
    },
    "summed": {"stixel_cli.answers.runs.Runs.metrics": _SHOWN_METRICS},
    "workers": {"stixel_cli.engine.plan.Durations.estimate": lambda *_: (0.0, [])},
}
"""What is replaced unless a test or its module has the mark.

Drawing, processes that import all libraries, and statistics of sixty metrics take nearly all of a
short run's time. Runs, sweeps and studies draw nothing without `drawn`; without `workers` all work
of `executor=local` counts as small, and is done in this process; without `summed` a sweep's
summary has the main metrics alone.
"""


SKETCHED = {
    "stixel_cli.pictures.style.png": lambda *figure: _empty("png"),
    "stixel_cli.pictures.style.svg": lambda figure: _empty("svg"),
}
"""With the mark `sketched` all is drawn as with `drawn`, but written as empty pictures.

To turn a figure into the bytes of its file takes longer than to draw it.
"""


@contextmanager
def runs_with(*marks: str) -> Iterator[None]:
    """Runs as with these marks, and with no other; afterwards as before."""
    marks += ("drawn",) if "sketched" in marks else ()
    whole = {name: _whole(name) for names in (*SHORT.values(), SKETCHED) for name in names}
    with pytest.MonkeyPatch.context() as patch:
        for mark, names in SHORT.items():
            for name, short in names.items():
                patch.setattr(name, whole[name] if mark in marks else short)
        for name, short in SKETCHED.items():
            patch.setattr(name, short if "sketched" in marks else whole[name])
        yield


_whole = cache(resolve_name)


@cache
def _empty(form: str) -> bytes:
    """The file of an empty figure."""
    return _whole(f"stixel_cli.pictures.style.{form}")(style.new_figure(1.0, 1.0))


def marks_of(node: pytest.Item | pytest.Module) -> list[str]:
    """Those of the marks that a test or a module has."""
    return [mark for mark in (*SHORT, "sketched") if node.get_closest_marker(mark)]


def short_python(script: str, *marks: str) -> list[str]:
    """The command of another Python that executes a file; its runs are as with these marks."""
    program = (
        f"import runpy, sys; sys.path.append({str(Path(__file__).parent)!r}); "
        "from short_runs import runs_with\n"
        f"with runs_with(*{marks}): runpy.run_path({script!r}, run_name='__main__')"
    )
    return [sys.executable, "-c", program]
