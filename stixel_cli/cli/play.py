"""`stixel play`: write a page that plays runs back."""

from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Folders, Output, TrustCode, Workers
from stixel_cli.cli.run import stored_run
from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError


def play(
    folders: Folders, output: Output = None, workers: Workers = None, trust_code: TrustCode = False
) -> int:
    """Write a page that plays back one or more runs of one scene.

    Missing results are computed. The page of one run is already in its folder, as index.html.

    \b
    Examples:
      stixel play results/gp results/point
      stixel play results/sweep/runs/0003
    """
    if output is not None and not output.parent.is_dir():
        raise UserError(f"--output: the folder {output.parent} does not exist")
    from stixel_cli.engine.progress import make_progress
    from stixel_cli.experiment.playback import folders_page
    from stixel_cli.report.compare import default_page, run_labels, write_page

    labels = run_labels(folders)
    stored = [stored_run(folder, workers, trust_code) for folder in folders]
    page, notes = folders_page(stored, labels, make_progress())
    for note in notes:
        tell(note)
    file = default_page(folders, "play") if output is None else output
    write_page(file, page)
    say(file)
    return 0
