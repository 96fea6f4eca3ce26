"""`stixel bench`: the benchmark of extended target trackers."""

from pathlib import Path
from typing import Annotated

import typer

from stixel_cli.cli.errors import tell
from stixel_cli.cli.options import Workers
from stixel_cli.cli.terminal import say
from stixel_cli.errors import UserError, counted

app = typer.Typer(rich_markup_mode=None, no_args_is_help=False)

Data = Annotated[
    Path, typer.Option("--data", metavar="DIR", help="Folder of the sequences.", show_default=True)
]
DATA = Path("bench-1.0")


@app.callback()
def bench() -> None:
    """Score extended target trackers on frozen sequences.

    \b
    Begin with:
      stixel bench render --mini           the sequences to develop on
      stixel bench run contour             tracks of one tracker, packed
      stixel bench score contour.zip       its row
      stixel bench page                    the table of all rows
    docs/benchmark-1.0.md has the protocol.
    """


@app.command()
def render(
    output: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder to write the sequences to.")
    ] = DATA,
    mini: Annotated[
        bool, typer.Option("--mini", help="Only seeds 0 and 1, to develop on.")
    ] = False,
    tune: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, metavar="N", help="Instead: N seeds from 1000 on, to tune on."
        ),
    ] = None,
    fresh: Annotated[
        Path | None,
        typer.Option(
            metavar="PACK",
            help="Instead: ten seeds that the SHA-256 of this pack draws.",
            show_default=False,
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="SEQUENCE", help="Only this one; repeatable.", show_default=False),
    ] = None,
    workers: Workers = None,
) -> int:
    """Render the sequences of the benchmark.

    It can be stopped at any time; the same command resumes. The last line is the id.
    """
    from stixel_cli.benchmark import sequences
    from stixel_cli.benchmark.data import sha256
    from stixel_cli.benchmark.render import render as write
    from stixel_cli.files import read_bytes

    given = {"--mini": mini, "--tune": tune, "--fresh": fresh, "--only": only}
    if len(names := [name for name, value in given.items() if value]) > 1:
        raise UserError(f"{names[0]} and {names[1]} exclude each other")
    if only:
        chosen = [sequences.named(name) for name in dict.fromkeys(only)]
    elif fresh is not None:
        chosen = sequences.fresh_set(sha256(read_bytes(fresh)))
    elif tune is not None:
        chosen = sequences.sequences(sequences.FROZEN, range(1000, 1000 + tune))
    else:
        chosen = sequences.mini_set() if mini else sequences.whole_set()
    text = write(chosen, output, workers, tell)
    say(f"{output}: {counted(len(chosen), 'sequence')}", sha256(text.encode()))
    return 0


@app.command()
def verify(folder: Annotated[Path, typer.Argument(metavar="DIR")] = DATA) -> int:
    """Check the sequences of a folder against its manifest, and against the published mini set.

    The exit code is 1 if a file is missing or differs.
    """
    from stixel_cli.benchmark.data import Data, published

    data = Data(folder)
    faults = data.faults()
    expected = published()
    differing = [path for path, one in data.files.items() if expected.get(path, one) != one]
    compared = len(expected.keys() & data.files.keys())
    say(
        *faults,
        *(f"{path}: differs from the published one" for path in differing),
        f"{counted(len(data.files), 'file')}, {len(faults)} damaged; {compared} published, "
        f"{len(differing)} of them differ",
        data.id,
    )
    return 1 if faults or differing else 0


@app.command()
def run(
    tracker: Annotated[
        str,
        typer.Argument(
            help="An option of tracker, pyrecest:NAME, or your own MODULE:FUNCTION.",
            metavar="TRACKER",
            show_default=False,
        ),
    ],
    settings: Annotated[
        list[str] | None,
        typer.Argument(help="Its settings.", metavar="tracker.KEY=VALUE", show_default=False),
    ] = None,
    data: Data = DATA,
    output: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the tracks (default: named after TRACKER)."),
    ] = None,
    start: Annotated[
        str, typer.Option(metavar="given|own", help="start.json, or from scans 0 to 9.")
    ] = "given",
) -> int:
    """Run a tracker on all sequences and pack its tracks.

    The pack is written beside the folder of the tracks. Edit tracker.json in that folder, and run
    bench pack again, to name version, code, licence and what the tracker was learnt from.
    """
    from stixel_cli.benchmark.data import Data as Folder
    from stixel_cli.benchmark.run import run as write

    if start not in ("given", "own"):
        raise UserError(f"--start: {start!r} must be given or own")
    folder = output or Path("-".join([tracker, *(settings or [])]).replace(":", "-"))
    write(tracker, settings or [], Folder(data), start, folder, tell)
    return pack(folder, data)


@app.command()
def pack(
    folder: Annotated[Path, typer.Argument(help="Folder of tracks.", metavar="DIR")],
    data: Data = DATA,
    output: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The pack (default: DIR.zip).")
    ] = None,
) -> int:
    """Pack tracks: one zip that bench score reads.

    The folder has tracker.json and one NAME.npz or NAME.csv for each sequence;
    docs/benchmark-1.0.md describes them. Tracks that are not complete are refused.
    """
    from stixel_cli.benchmark.data import Data as Folder
    from stixel_cli.benchmark.packs import pack as write
    from stixel_cli.benchmark.run import this_machine

    target = output or folder.with_name(f"{folder.name}.zip")
    sequences = Folder(data)
    missing = write(folder, sequences, this_machine(sequences), target)
    for name, count in missing.items():
        tell(f"{name}: {counted(count, 'scan')} without an estimate: their IoU is 0")
    say(target)
    return 0


Rows = Annotated[
    Path, typer.Option("--rows", metavar="DIR", help="Folder of rows; a checkout has one.")
]
ROWS = Path("pipelines/bench/rows")


@app.command()
def score(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Packs.", metavar="FILE…", show_default=False)
    ] = None,
    data: Data = DATA,
    rows: Rows = ROWS,
    tier: Annotated[
        str,
        typer.Option(metavar="scored|rerun", help="Tracks were handed in, or code was run here."),
    ] = "scored",
    fresh_of: Annotated[
        Path | None,
        typer.Option(metavar="PACK", help="The pack that drew the seeds of DIR: tier fresh."),
    ] = None,
    fixed: Annotated[
        bool,
        typer.Option("--fixed", help="Also the rows of true box and best star-convex contour."),
    ] = False,
) -> int:
    """Score packs and write a row of each.

    Scores in a pack or a row are never trusted: they are computed here, from the tracks.
    """
    from stixel_cli.benchmark.data import Data as Folder
    from stixel_cli.benchmark.data import sha256
    from stixel_cli.benchmark.score import TIERS, fixed_rows, scored_pack, write_row
    from stixel_cli.files import read_bytes

    if tier not in TIERS:
        raise UserError(f"--tier: {tier!r} must be one of {', '.join(TIERS)}")
    sequences = Folder(data)
    drawn_by = "" if fresh_of is None else sha256(read_bytes(fresh_of, 2**30))
    found = [scored_pack(file, sequences, tier, drawn_by) for file in files or ()]
    for row in [*found, *(fixed_rows(sequences) if fixed else ())]:
        values = row["scores"]["iou_mean"]
        tracker = row["tracker"]
        say(
            f"{tracker['name']} {tracker['version']}: mean IoU {sum(values) / len(values):.4f}",
            write_row(row, rows),
        )
    return 0
