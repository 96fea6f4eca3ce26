"""Runs of this process are short: they draw nothing and start no processes, unless a test asks."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pkgutil import resolve_name

import pytest

SHORT = {
    "drawn": {
        "stixel_cli.experiment.run.PICTURES": (),
        "stixel_cli.sweeps.page.sweep_page": lambda *_, **given: "",
        "stixel_cli.studies.run.study_page": lambda *_: "",
    },
    "workers": {"stixel_cli.engine.plan.Durations.estimate": lambda *_: (0.0, [])},
}
"""What is replaced unless a test or its module has the mark.

Drawing, and processes that import all libraries, take nearly all of a short run's time. Runs,
sweeps and studies draw nothing without `drawn`; without `workers` all work of `executor=local`
counts as small, and is done in this process.
"""


@contextmanager
def runs_with(*marks: str) -> Iterator[None]:
    """Runs as with these marks, and with no other; afterwards as before."""
    whole = {name: _whole(name) for names in SHORT.values() for name in names}
    with pytest.MonkeyPatch.context() as patch:
        for mark, names in SHORT.items():
            for name, short in names.items():
                patch.setattr(name, whole[name] if mark in marks else short)
        yield


_whole = cache(resolve_name)


def marks_of(node: pytest.Item | pytest.Module) -> list[str]:
    """Those of the marks that a test or a module has."""
    return [mark for mark in SHORT if node.get_closest_marker(mark)]
