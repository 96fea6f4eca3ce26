"""Write the tables of docs/real-data.md: STIXEL_DATA=DIR python docs/real_data.py

A block of that page names its command, `<!-- from SCRIPT ARGUMENT… -->`, and has what it prints.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parent / "real-data.md"
BLOCK = re.compile(r"(<!-- from ([^\n]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def written(block: re.Match) -> str:
    """A block with what its command prints: tables, and a list of the lines beside them."""
    command = [sys.executable, *shlex.split(os.path.expandvars(block[2]))]
    printed = subprocess.check_output(command, cwd=PAGE.parents[1], text=True)
    text = re.sub(r"^(?=[^|])", "- ", printed, flags=re.MULTILINE)
    text = re.sub(r"(?<=\|\n)(?=- )", "\n", text)
    return f"{block[1]}\n{text}\n{block[3]}"


if __name__ == "__main__":
    PAGE.write_text(BLOCK.sub(written, PAGE.read_text(encoding="utf-8")), encoding="utf-8")
