"""`stixel export`: write a run in the format of other tools."""

import shlex
from pathlib import Path

from stixel_cli.cli import options
from stixel_cli.cli.run import stored_run
from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError

NAMES = "kitti|csv|tum|stx1|rerun|mlflow"
"""The formats, here because completion must not import them."""


def export(
    folder: options.Folder,
    format: options.option(
        str,
        "kitti: images, calibration, labels, poses, disparity as a clip of KITTI's "
        "tracking benchmark. csv: scans, track, truth, contours, and their columns. tum: "
        "trajectories, as evo reads them. stx1: stixels for pyStixel-lib. rerun: run.rrd. "
        "mlflow: settings, scores, pages, of a sweep too.",
        NAMES,
        "--format",
        autocompletion=lambda incomplete: [
            name for name in NAMES.split("|") if name.startswith(incomplete)
        ],
        show_default=False,
    ),
    output: options.NewFolder = None,
    workers: options.Workers = None,
    trust_code: options.TrustCode = False,
) -> int:
    """Write a run, or with mlflow a sweep, in the format of other tools.

    Missing results are computed, but for mlflow.

    \b
    Examples:
      stixel export results/contour --format kitti --output clip
      stixel export results/contour --format csv
      stixel export results/my_sweep --format mlflow
    """
    from stixel_cli.engine.progress import Progress
    from stixel_cli.export.export import export as write
    from stixel_cli.export.mlflow_folder import export_mlflow

    known = NAMES.split("|")
    if format not in known:
        raise UserError(f"--format: {format!r} is not known: must be one of {', '.join(known)}")
    target = options.new_file(output or Path(f"{folder.resolve().name}-{format}"))
    if format == "mlflow":
        export_mlflow(folder.resolve(), target.absolute())
    else:
        stored = stored_run(folder, workers, trust_code)
        answer = write(stored, target.absolute(), format, Progress(visible=True))
    say(target)
    if format == "kitti":
        say(shlex.join(["stixel", "run", *answer]))
    return 0
