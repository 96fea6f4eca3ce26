"""Small inputs, for the test that runs every script.

STIXEL_BENCH_SMALL names the folder for the page then. Without it everything has its whole size.
"""

import os

FOLDER = os.environ.get("STIXEL_BENCH_SMALL")
IMAGES = ("rig.width=160", "rig.height=120") if FOLDER else ()
"""Overrides for small images."""


def sized(whole, small):
    """`whole`, or `small` where the variable is set."""
    return small if FOLDER else whole
