"""`stixel bench`: the benchmark of extended target trackers; docs/benchmark-1.0.md."""

from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import typer

from stixel_cli.cli import options
from stixel_cli.cli.terminal import say, tell
from stixel_cli.errors import UserError, counted

app = typer.Typer(name="bench", rich_markup_mode=None, no_args_is_help=False)

FOLDER, ROWS, SITE = Path("bench-1.0"), Path("pipelines/bench/rows"), Path("bench-page")
Folder = options.option(Path, "Folder of the sequences.", "DIR", "--data")
Rows = options.option(Path, "Folder of the rows.", "DIR")
Packs = options.argument(list[Path] | None, "Packs.", "PACK…")
Pack = options.option(Path | None, "The pack that draws the seeds.", "PACK")


@app.callback()
def bench() -> None:
    """Score trackers on frozen sequences: render, run, score, page."""


@app.command()
def render(
    folder: Folder = FOLDER,
    mini: options.flag("--mini", "Seeds 0 and 1 only.") = False,
    part: options.option(str, "Another part, such as guest_demo.") = "",
    fresh: Pack = None,
    sensor: options.option(str, "Only its sequences.") = "",
    only: options.option(list[str] | None, "A sequence, of any seed.") = None,
    workers: options.Workers = None,
) -> int:
    """Render the sequences, or those that a pack draws, and print their id; repeat it to resume."""
    from stixel_cli.benchmark import sequences

    chosen = [sequences.named(name) for name in dict.fromkeys(only or ())]
    if fresh is not None:
        chosen = sequences.fresh_set(sequences.sha256_of(fresh))
    if part:
        chosen = sequences.sequences(part)
    chosen = chosen or sequences.whole_set(mini)
    sensors = {one.sensor: None for one in chosen}
    if sensor and sensor not in sensors:
        raise UserError(f"--sensor: {sensor[:80]!r}: must be one of {', '.join(sensors)}")
    chosen = [one for one in chosen if sensor in ("", one.sensor)]
    sequences.render(chosen, folder, workers, tell)
    say(f"{folder}: {counted(len(chosen), 'sequence')}", sequences.Data(folder).id)
    return 0


@app.command()
def verify(folder: Folder = FOLDER) -> int:
    """Check sequences against their manifest and the published mini set."""
    from stixel_cli.benchmark.sequences import FILES, Data, bench_folder
    from stixel_cli.border.files import read_json

    file = bench_folder() / "MANIFEST-mini.json"
    data, known = Data(folder), read_json(file)["files"] if file.exists() else {}
    other = [path for path, one in data.files.items() if known.get(path, one) != one]
    truths = [path for path in other if not path.endswith(FILES[0])]
    faults = [*data.faults(), *(f"{path}: differs from the published one" for path in truths)]
    if scans := len(other) - len(truths):
        tell(f"{FILES[0]} of {counted(scans, 'sequence')} differ: another processor or revision")
    common = len(known.keys() & data.files.keys())
    say(*faults, f"{counted(len(data.files), 'file')}, {common} published", data.id)
    return 1 if faults else 0


@app.command()
def run(
    tracker: options.argument(str, "An option of tracker, or pyrecest:NAME.", "TRACKER"),
    settings: options.argument(list[str] | None, "Its settings.", "tracker.KEY=VALUE") = None,
    folder: Folder = FOLDER,
    own_start: options.flag("--own-start", "From scans 0 to 9.") = False,
) -> int:
    """Run TRACKER, as in tracker=… or pyrecest:NAME, on all sequences, and pack its tracks."""
    from stixel_cli.benchmark.run import run as write
    from stixel_cli.benchmark.sequences import Data

    return pack(write(tracker, settings or (), own_start, Data(folder), tell), folder)


@app.command()
def pack(
    tracks: options.argument(Path, "Folder of the tracks.", "DIR"), folder: Folder = FOLDER
) -> int:
    """Pack a folder of tracks: tracker.json, and NAME.npz or NAME.csv for each sequence."""
    from stixel_cli.benchmark.packs import pack as write
    from stixel_cli.benchmark.run import this_machine
    from stixel_cli.benchmark.sequences import Data

    target, data = tracks.with_name(f"{tracks.name}.zip"), Data(folder)
    for name, count in write(tracks, data, this_machine(data), target).items():
        tell(f"{name}: {counted(count, 'scan')} without an estimate, scored as IoU 0")
    say(target)
    return 0


def _check_packs(packs: Iterable[Path]) -> None:
    for file in (file for file in packs if not file.is_file()):
        known = sorted(one.name for one in file.absolute().parent.glob("*.zip"))
        raise UserError(f"{file}: no such pack; the ZIP files there: {', '.join(known) or 'none'}")


@app.command()
def score(
    packs: Packs = None,
    folder: Folder = FOLDER,
    rows: Rows = ROWS,
    rerun: options.flag("--rerun", "You ran the tracker.") = False,
    fresh_of: Pack = None,
    fixed: options.flag("--fixed", "Add the true box.") = False,
) -> int:
    """Score packs from their tracks, and write a row of each; --fresh-of drew the seeds."""
    from stixel_cli.benchmark.packs import MISSING, fixed_rows, scored_pack, write_row
    from stixel_cli.benchmark.sequences import Data, sha256_of

    _check_packs(packs or ())
    data, drawn_by = Data(folder), "" if fresh_of is None else sha256_of(fresh_of)
    tier = "rerun" if rerun else "scored"
    found = [scored_pack(file, data, tier, drawn_by) for file in packs or ()]
    for row in [*found, *(fixed_rows(data) if fixed else ())]:
        ious, file = row["scores"]["iou_mean"], write_row(row, rows)
        if missing := int(sum(row["scores"].get(MISSING, ()))):
            tell(f"{counted(missing, 'scan')} without an estimate before the next scan: IoU 0")
        say(f"{row['tracker']['name']}: mean IoU {sum(ious) / len(ious):.4f}: {file}")
    return 0


@app.command()
def page(
    packs: Packs = None,
    folder: Folder = FOLDER,
    rows: Rows = ROWS,
    output: options.option(Path, "Folder of the page.", "DIR") = SITE,
) -> int:
    """Write a page, CSV and Markdown of each set of sequences, with all rows, the shipped ones too.

    Each sequence of PACKs gets a page that plays back their tracks.
    """
    from stixel_cli.benchmark.packs import read_rows
    from stixel_cli.benchmark.page import bench_pages, playback_pages
    from stixel_cli.benchmark.sequences import Data, bench_folder, sha256_of
    from stixel_cli.border.origins import write_below, written

    _check_packs(packs or ())
    if rows != ROWS and not rows.is_dir():
        raise UserError(f"--rows: {rows}: no such folder")
    folders = dict.fromkeys([(bench_folder() / "rows").resolve(), rows.resolve()])
    found = [row for one in folders for row in read_rows(one)]
    given = [("--data", folder, FOLDER), ("--rows", rows, ROWS), ("--output", output, SITE)]
    command = ["stixel", "bench", "page", *map(str, packs or ())]
    command += [word for name, own, usual in given if own != usual for word in (name, str(own))]
    files = bench_pages(found, [*map(sha256_of, packs or ())], command)
    played = playback_pages(packs, Data(folder)) if packs else ()
    with written(output):
        # One playback page after the other: together they need not fit into memory.
        for name, content in chain(played, files.items()):
            write_below(output, {name: content})
    say(output / "index.html")
    return 0
