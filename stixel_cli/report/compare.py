"""Names of compared runs, and of the files that are written of them."""

from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path

from stixel_cli.errors import UserError

_LONGEST_NAME = 150


def run_labels(folders: Sequence[Path]) -> list[str]:
    """Name of each run: its folder's name, with the parents' names where that is not unique.

    Raises:
        UserError: if a folder is named twice.
    """
    paths = [folder.resolve() for folder in folders]
    for parts in range(1, max(len(path.parts) for path in paths) + 1):
        labels = ["/".join(path.parts[-parts:]) for path in paths]
        if len(set(labels)) == len(labels):
            return labels
    raise UserError("two arguments name the same folder; give each folder once")


def default_page(folders: Sequence[Path], what: str = "report", suffix: str = "html") -> Path:
    """An unused file next to the first folder, named by `what` and the folders' names."""
    first, *others = (folder.resolve().name for folder in folders)
    stem = "-".join([what, first, *others])
    if len(stem) > _LONGEST_NAME:
        stem = f"{what}-{first}"[:_LONGEST_NAME] + f"-and-{len(others)}-more"
    parent = folders[0].parent if folders[0].name not in ("", "..") else folders[0].resolve().parent
    return unused_page(parent / f"{stem}.{suffix}")


def unused_page(page: Path) -> Path:
    """The file, or one with a number at the end of its name if it exists."""
    numbered = (page.with_name(f"{page.stem}-{number}{page.suffix}") for number in count(2))
    return next(file for file in chain([page], numbered) if not file.exists())
