"""Experiments in extended target tracking on stixels.

From Python: `from stixel_cli import compose, plot, run, sweep`, see `stixel_cli.api`.
"""

from stixel_cli.version import __version__

__all__ = ["__version__", "compose", "plot", "run", "sweep"]


def __getattr__(name):
    # Importing this package costs nothing: what these need is imported when they are asked for.
    if name in __all__:
        from stixel_cli import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
