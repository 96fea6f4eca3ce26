"""`stixel calibrate`: estimate the disparity error of a recording's rig."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stixel_cli.cli.completion import complete_override
from stixel_cli.cli.options import Json, Workers, argument, with_workers, without_target
from stixel_cli.cli.terminal import print_json, say

if TYPE_CHECKING:
    from stixel_cli.calibration.disparity_fit import DisparityFit
    from stixel_cli.recordings.parameters import Recorded


def calibrate(
    overrides: Annotated[
        list[str],
        argument("The recording, as for run: source.folder=DIR …", "OVERRIDE", complete_override),
    ],
    method: Annotated[
        str | None,
        typer.Option(
            "--from",
            help="labels: the faces of labelled cars that are fully visible. truth: true "
            "disparities, with which patches of the images are aligned. motion: static points, "
            "tracked from image to image; needs poses of the ego car, but no truth. Default: the "
            "first for which the recording has the files.",
            metavar="labels|truth|motion",
            show_default=False,
        ),
    ] = None,
    workers: Workers = None,
    json: Json = False,
) -> int:
    """Estimate the disparity error of a recording's rig.

    Print the overrides that correct the error and record how it was estimated. With labels, fit on
    some of the frames (source.frames=0:8) and score on the others.

    \b
    Examples:
      stixel calibrate source.folder=DIR source.sequence=0005 source.frames=0:8
      stixel calibrate source.folder=DIR source.sequence=0005 --from motion
    """
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.assess import calibrate as estimate

    composition = compose(with_workers(without_target(overrides), workers))
    fit = estimate(composition, method, make_progress())
    source = composition.configuration.source
    text = correction_text(fit, source)
    if json:
        print_json(
            asdict(fit) | {"correction": text, "folder": source.folder, "frames": source.frames}
        )
        return 0
    values = {
        "rig.disparity_offset": f"{fit.offset:.3f}",
        "rig.disparity_slope": f"{fit.slope:.6f}",
        # Quotes of Hydra's grammar: the text has commas and blanks.
        "source.correction": f'"{text}"',
    }
    say(
        shlex.join(f"{name}={value}" for name, value in values.items()),
        f"median residual {fit.median_before:.2f} px before, {fit.median_after:.2f} px after",
    )
    return 0


def correction_text(fit: "DisparityFit", source: "Recorded") -> str:
    """How a correction was estimated: the method, the clip, n and the residual."""
    clip = getattr(source, "sequence", None) or Path(source.folder).name
    clip = "".join(letter for letter in clip if letter.isalnum() or letter in "-_. ")
    return (
        f"{fit.method} of clip {clip}, frames {source.frames.replace(':', ' to ')} (exclusive), "
        f"{fit.count} {fit.unit}, median residual {fit.median_after:.2f} px"
    )
