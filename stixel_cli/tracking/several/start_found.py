"""Initialisation of a run's track where the target is not chosen."""

from stixel_cli.tracking.several.found import FoundTrack
from stixel_cli.tracking.track import InitialState


def start_from_found(found: tuple[FoundTrack, ...]) -> InitialState:
    """The initial state of the road user that is in most scans, one sample before the first scan.

    Raises:
        ValueError: without any.
    """
    if not found:
        raise ValueError(
            "source.target: auto finds no cluster of the class's size that moves: name a labelled "
            "target, or leave it out and give start.bearing=[LO,HI] (degrees)"
        )
    return max(found, key=lambda one: len(one.scans)).initial_of_run
