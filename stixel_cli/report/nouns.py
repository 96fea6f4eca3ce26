"""What the picture stages give."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Pictures:
    """Finished pictures.

    Attributes:
        files: name relative to the folder of figures (`k0033/left.png`, `path.svg`) to the bytes
            of the file.
    """

    files: dict[str, bytes]
