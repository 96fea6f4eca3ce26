"""`stixel calibrate`: estimate the disparity error of a recording's rig."""

import sys
from dataclasses import asdict
from typing import Annotated

import typer

from stixel_cli.cli.completion import complete_override
from stixel_cli.cli.options import Json, Workers
from stixel_cli.cli.run import with_workers
from stixel_cli.cli.terminal import print_json


def calibrate(
    overrides: Annotated[
        list[str],
        typer.Argument(
            help="The recording, as for run: source.folder=DIR …",
            metavar="OVERRIDE",
            autocompletion=complete_override,
            show_default=False,
        ),
    ],
    workers: Workers = None,
    json: Json = False,
) -> int:
    """Estimate the disparity error of a recording's rig.

    It compares the stixels of all labelled cars that are fully visible with the faces of their
    boxes. Fit on some of the frames (source.frames=0:8) and score on the others.

    \b
    Examples:
      stixel calibrate source.folder=DIR source.sequence=0005 source.frames=0:8
    """
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.calibrate import calibrate as estimate

    names = {text.partition("=")[0] for text in overrides}
    if "source.target" not in names:
        # A recording without target needs these, and the stixels do not depend on them.
        further = {"road_user": "car", "start": "scans", "start.bearing": "[-45,45]"}
        overrides = [*overrides, *(f"{k}={v}" for k, v in further.items() if k not in names)]
    composition = compose(with_workers(overrides, workers))
    found = estimate(composition, make_progress())
    source = composition.configuration.source
    if json:
        print_json(asdict(found) | {"folder": source.folder, "frames": source.frames})
        return 0
    sys.stdout.write(
        f"rig.disparity_offset={found.offset:.3f} rig.disparity_slope={found.slope:.6f}\n"
        f"from {found.labels} labels of {found.tracks} cars, frames {source.frames} of "
        f"{source.folder}; median error {found.median_before:.2f} px before, "
        f"{found.median_after:.2f} px after\n"
    )
    return 0
