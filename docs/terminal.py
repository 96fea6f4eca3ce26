"""Write the pictures of the terminal in the README: each is the output of its commands.

    python docs/terminal.py [NAME …]

The commands run in an empty folder, with an empty cache. Without names it writes all pictures.
"""

import os
import pty
import re
import shlex
import subprocess
import sys
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

FIGURES = Path(__file__).parent / "figures"
WIDTH = 100
"""Characters of a line."""

PICTURES = {
    "terminal_run": ["stixel run --name default"],
    "terminal_describe": ["stixel describe tracker.sigma_f", "stixel run tracker.sigma=0.5"],
}
"""Name of a picture to its commands."""

FORMAT = """<svg class="rich-terminal" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">
<style>
.{unique_id}-matrix {{ font-family: ui-monospace, Menlo, Consolas, "DejaVu Sans Mono", monospace;
font-size: {char_height}px; line-height: {line_height}px; font-variant-east-asian: full-width; }}
{styles}
</style>
<defs>
<clipPath id="{unique_id}-clip-terminal">
<rect x="0" y="0" width="{terminal_width}" height="{terminal_height}"/>
</clipPath>
{lines}
</defs>
{chrome}
<g transform="translate({terminal_x}, {terminal_y})" clip-path="url(#{unique_id}-clip-terminal)">
{backgrounds}
<g class="{unique_id}-matrix">
{matrix}
</g>
</g>
</svg>
"""
"""Rich's, with fonts of the reader's machine: a picture must not load anything."""


def output_on_a_terminal(command: str, folder: Path) -> str:
    """What a command prints on a terminal of `WIDTH` characters, with its colours."""
    reader, writer = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(WIDTH)}
    environment["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), environment["PATH"]])
    environment["STIXEL_CACHE"] = str(folder / "cache")
    # Only stdout is a terminal: progress bars are not part of a picture.
    with subprocess.Popen(
        shlex.split(command), cwd=folder, env=environment, stdout=writer, stderr=subprocess.PIPE
    ) as process:
        os.close(writer)
        parts = []
        while True:
            try:
                part = os.read(reader, 65536)
            except OSError:  # how Linux reports the end of a terminal
                break
            if not part:
                break
            parts.append(part)
        error = process.stderr.read().decode()
    os.close(reader)
    text = b"".join(parts).decode().replace("\r\n", "\n")
    # Of a wrong command, its message; of another one, not its progress.
    return text + (error if process.returncode else "")


def picture(commands: list[str]) -> str:
    """The SVG of the commands and their outputs."""
    console = Console(record=True, file=StringIO(), width=WIDTH, color_system="truecolor")
    with TemporaryDirectory() as folder:
        for command in commands:
            console.print(Text("$ ", "bold green") + Text(command, "bold"))
            console.print(Text.from_ansi(output_on_a_terminal(command, Path(folder))))
    svg = console.export_svg(
        title="stixel", code_format=FORMAT, theme=MONOKAI, unique_id="terminal"
    )
    return re.sub(r"[ \t]+$", "", svg, flags=re.MULTILINE)


def main(names: list[str]) -> None:
    """Write the pictures of these names, or all."""
    for name in names or PICTURES:
        if name not in PICTURES:
            raise SystemExit(f"{name}: unknown picture; there are {', '.join(PICTURES)}")
        (FIGURES / f"{name}.svg").write_text(picture(PICTURES[name]), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
