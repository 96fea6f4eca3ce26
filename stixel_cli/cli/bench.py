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
