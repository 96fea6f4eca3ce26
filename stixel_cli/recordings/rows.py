"""Rows of numbers in text files of any origin: each fault in one line, with file and row."""

import math
from pathlib import Path

from stixel_cli.errors import UserError, printable
from stixel_cli.files import read_text

MOST_ROWS = 1_000_000


def text_rows(file: Path) -> list[tuple[int, list[str]]]:
    """Number (from 1) and words of each row that is not empty.

    Raises:
        UserError: if the file is missing, not a text, or has more than `MOST_ROWS` rows.
    """
    lines = read_text(file).splitlines()
    if len(lines) > MOST_ROWS:
        raise UserError(f"{file}: more than {MOST_ROWS} rows")
    return [(i, line.split()) for i, line in enumerate(lines, 1) if line.strip()]


def numbers(file: Path, row: int, words: list[str]) -> list[float]:
    """The words of a row as finite numbers.

    Raises:
        UserError: if a word is not a finite number.
    """
    found = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            raise UserError(f"{file}: row {row}: {printable(word)!r} is not a number") from None
        if not math.isfinite(value):
            raise UserError(f"{file}: row {row}: {printable(word)} is not finite")
        found.append(value)
    return found


def check_columns(file: Path, row: int, words: list[str], needed: int) -> None:
    """Raise UserError unless the row has `needed` columns."""
    if len(words) != needed:
        raise UserError(f"{file}: row {row}: {needed} columns are needed, got {len(words)}")
