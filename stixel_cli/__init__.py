"""Experiments in extended target tracking on stixels.

From Python: `from stixel_cli import compose, load, plot, run, sweep, track`, see `stixel_cli.api`;
trackers that take one scan after the other are in `stixel_cli.trackers`; for
stixels of your own images, `from stixel_cli import stixels_from_pair`, see `stixel_cli.live.pairs`.
"""

from stixel_cli.version import __version__

_MODULES = {
    "stixel_cli.api": ("compose", "load", "plot", "run", "sweep", "track"),
    "stixel_cli.evaluation.evaluate": ("evaluate",),
    "stixel_cli.measurements.scans": ("Scans",),
    "stixel_cli.live.pairs": ("stixels_from_disparity", "stixels_from_pair"),
    "stixel_cli.live.stream": ("StixelStream",),
    "stixel_cli.answers.runs": ("Runs",),
}
_FUNCTIONS = sorted(name for names in _MODULES.values() for name in names)
__all__ = ["__version__", *_FUNCTIONS, "trackers"]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> object:
    # Importing this package costs nothing: what these need is imported when they are asked for.
    from importlib import import_module

    if name == "trackers":
        return import_module("stixel_cli.trackers")
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
