"""Experiments in extended target tracking on stixels.

From Python: `from stixel_cli import compose, load, plot, run, sweep`, see `stixel_cli.api`; for
stixels of your own images, `from stixel_cli import stixels_from_pair`, see `stixel_cli.pairs`.
"""

from stixel_cli.version import __version__

_MODULES = {
    "stixel_cli.api": ("compose", "load", "plot", "run", "sweep"),
    "stixel_cli.pairs": ("stixels_from_disparity", "stixels_from_pair"),
    "stixel_cli.stream": ("StixelStream",),
}
__all__ = ["__version__", *sorted(name for names in _MODULES.values() for name in names)]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> object:
    # Importing this package costs nothing: what these need is imported when they are asked for.
    for module, names in _MODULES.items():
        if name in names:
            from importlib import import_module

            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
