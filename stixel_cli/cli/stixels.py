"""`stixel stixels`: the stixels of two images or of a recording, as a table and pictures."""

from pathlib import Path

from stixel_cli.cli import options
from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError


def stixels(
    arguments: options.ImagesOrRecording = None,
    rig: options.RigFile = None,
    output: options.NewFolder = None,
    workers: options.Workers = None,
) -> int:
    """Write the stixels of two images, or of all frames of a recording, as a table and pictures.

    stixels.csv has one row per stixel; kNNNN.png shows the stixels over the image of frame NNNN, of
    four frames, or of those of pictures.frames.

    \b
    Examples:
      stixel stixels left.png right.png --rig rig.yaml
      stixel stixels drive.mcap ego=parked
      stixel stixels DIR source.sequence=0005 extraction.width=5
    """
    from stixel_cli.config.compose import compose
    from stixel_cli.engine.progress import Progress
    from stixel_cli.experiment.stages import compared_rows, computed_stages
    from stixel_cli.results.folder import csv_text, write_whole_folder
    from stixel_cli.results.tables import stixel_columns

    given = options.recording_overrides("stixels", arguments or [], {"calibration": rig})
    if not given:
        raise UserError("stixels needs two images, LEFT and RIGHT, or the folder of a recording")
    composition = compose(options.with_workers(given, workers))
    source = composition.resolved["source"]
    named = Path(source.get("left") or source.get("folder") or "run").stem
    target = options.new_file(Path(f"stixels-{named}") if output is None else output)
    wanted, progress = ["stixels", "camera_pictures"], Progress(visible=True)
    compared_rows(composition, progress.note)
    with computed_stages(composition, wanted, progress) as (_, load):
        chunks, drawn = map(load, wanted)
    if not chunks:
        raise UserError(f"measurement: {composition.choices['measurement']} has no stixels")
    pictures = {path: data for one in drawn for path, data in one.files.items()}
    shown = [path for path in pictures if path.endswith("/stixels.png")]
    files = {path.replace("/stixels", ""): pictures[path] for path in shown}
    files["stixels.csv"] = csv_text(stixel_columns(chunks))
    write_whole_folder(target.absolute(), files)
    say(target)
    return 0
