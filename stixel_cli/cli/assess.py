"""`stixel assess`: how good the stixels of one pair of images are."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.completion import complete_override
from stixel_cli.cli.options import Json, Workers, argument, check_output
from stixel_cli.cli.run import with_workers, without_target
from stixel_cli.cli.terminal import print_json, print_table, say
from stixel_cli.errors import UserError


def assess(
    arguments: Annotated[
        list[str],
        argument(
            "The left and the right image, or a recording (source.folder=DIR …); "
            "then overrides as for run.",
            "LEFT RIGHT [OVERRIDE]",
            complete_override,
        ),
    ],
    calib: Annotated[
        Path | None,
        typer.Option(
            "--calib", help="Calibration of the pair: KITTI's file or a rig.yaml.", metavar="FILE"
        ),
    ] = None,
    disparity: Annotated[
        Path | None,
        typer.Option(
            help="True disparities: PNG of 16 bits, 256 per px, 0 for unknown.", metavar="FILE"
        ),
    ] = None,
    labels: Annotated[
        Path | None, typer.Option(help="KITTI's labels of the pair.", metavar="FILE")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Output file (default: assess.html)."),
    ] = None,
    workers: Workers = None,
    json: Json = False,
) -> int:
    """Assess the stixels of one pair of images on one page.

    It shows the share of the columns that have stixels, their errors against true disparities, the
    offset between the images and the truth, missed obstacles and run times.

    \b
    Examples:
      stixel assess left.png right.png --calib rig.yaml
      stixel assess left.png right.png --calib 000074.txt --disparity disp_occ/000074_10.png
      stixel assess source.folder=DIR source.sequence=000074
    """
    check_output(output)
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.assess import assess as assessed
    from stixel_cli.report.assess import LABELS, page_html, sentences, shown
    from stixel_cli.report.compare import unused_page, write_page

    files = [text for text in arguments if "=" not in text]
    given = [text for text in arguments if "=" in text]
    if files:
        given = [*_pair(files, calib, disparity, labels), *given]
    elif calib or disparity or labels:
        raise UserError("--calib, --disparity and --labels belong to two images: LEFT RIGHT")
    given = [*without_target(given), "pictures.frames=[0]"]
    composition = compose(with_workers(given, workers))
    assessment = assessed(composition, make_progress())
    if json:
        print_json({"values": dict(assessment.values), "seconds": dict(assessment.seconds)})
        return 0
    page = unused_page(Path("assess.html")) if output is None else output
    command = [arg for arg in ("stixel", "assess", *arguments) if arg]
    for name, value in (("--calib", calib), ("--disparity", disparity), ("--labels", labels)):
        command += [] if value is None else [name, str(value)]
    write_page(page, page_html(assessment, shlex.join(command)))
    rows = [
        (label, shown(name, assessment.values[name]), unit)
        for name, (label, unit, _) in LABELS.items()
        if assessment.values[name] is not None
    ]
    print_table(("value", "", "unit"), rows, right=(1,))
    say("", *sentences(assessment), page)
    return 0


def _pair(
    files: list[str], calib: Path | None, disparity: Path | None, labels: Path | None
) -> list[str]:
    """The overrides that name the files of a pair."""
    if len(files) != 2:
        raise UserError(f"assess needs two images, LEFT and RIGHT, got {len(files)}: {files[0]} …")
    if calib is None:
        raise UserError("--calib: is required with two images: KITTI's file or a rig.yaml")
    named = {"folder": files[0], "right": files[1], "calibration": calib}
    named |= {"disparity": disparity, "labels": labels}
    quoted = {
        name: "'" + str(file).replace("'", "\\'") + "'"
        for name, file in named.items()
        if file is not None
    }
    return ["source=pair", *(f"source.{name}={file}" for name, file in quoted.items())]
