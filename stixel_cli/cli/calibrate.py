"""`stixel calibrate`: estimate the disparity error of a recording's rig."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.completion import complete_override
from stixel_cli.cli.options import Json, Workers, argument, new_file, with_workers, without_target
from stixel_cli.cli.terminal import print_json, say


def calibrate(
    overrides: Annotated[
        list[str],
        argument("The recording, as for run: source.folder=DIR …", "OVERRIDE", complete_override),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Also write the rig to this file, for source.calibration=FILE with other "
            "recordings of the same camera.",
            callback=new_file,
        ),
    ] = None,
    workers: Workers = None,
    json: Json = False,
) -> int:
    """Estimate the disparity error of a recording's rig.

    The motion of its camera shows it: static points, tracked from image to image. Print the
    overrides that correct the error, and how well it is known.

    \b
    Examples:
      stixel calibrate source.folder=DIR source.sequence=0005 --output rig.yaml
    """
    from stixel_cli.border import write_new
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.assess import calibrate as estimate
    from stixel_cli.recordings.rig_files import rig_text

    composition = compose(with_workers(without_target(overrides), workers))
    found = estimate(composition, make_progress())
    if output is not None:
        write_new(output, rig_text(found.rig, found.text))
    medians = {"before": found.median_before, "after": found.median_after}
    medians = {name: median for name, median in medians.items() if median >= 0.0}
    if json:
        residuals = {f"median_{name}": median for name, median in medians.items()}
        print_json({"text": found.text, **found.values, **residuals})
        return 0
    values = {name: found.values[name] for name in ("disparity_error", "disparity_error_std")}
    say(
        shlex.join(f"rig.{name}={str(value).replace(' ', '')}" for name, value in values.items()),
        found.text,
        *(f"median residual {name}: {median:.2f} px" for name, median in medians.items()),
    )
    return 0
