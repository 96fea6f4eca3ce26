"""Sizes and ages as people write them: `10GB`, `30d`."""

import re

_SIZES = {
    "": 1,
    "B": 1,
    **{f"{prefix}B": 1000**power for power, prefix in enumerate("KMGT", 1)},
    **{f"{prefix}IB": 1024**power for power, prefix in enumerate("KMGT", 1)},
}
_AGES = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}


def parse_size(text: str) -> int:
    """Bytes of `500MB`, `10 GB`, `1.5TiB`, `4096`.

    Raises:
        ValueError: in one line, if it is no size.
    """
    number, unit = _split(text)
    if number is None or unit.upper() not in _SIZES:
        raise ValueError(f"{text!r} is no size: write 500MB, 10GB, 1.5TB")
    return int(number * _SIZES[unit.upper()])


def parse_age(text: str) -> float:
    """Seconds of `90s`, `10min`, `12h`, `30d`, `4w`.

    Raises:
        ValueError: in one line, if it is no age.
    """
    number, unit = _split(text)
    if number is None or unit not in _AGES:
        raise ValueError(f"{text!r} is no age: write 10min, 12h, 30d, 4w")
    return number * _AGES[unit]


def show_size(size: int) -> str:
    """Bytes in three digits or four: `4.2 GB`."""
    value, units = float(size), ["B", "KB", "MB", "GB", "TB"]
    while value >= 999.5 and len(units) > 1:
        value /= 1000.0
        units.pop(0)
    return (
        f"{value:.0f} {units[0]}"
        if value >= 99.95 or units[0] == "B"
        else (f"{value:.1f} {units[0]}")
    )


def _split(text: str) -> tuple[float | None, str]:
    found = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,9})?)\s*([A-Za-z]*)\s*", text, re.ASCII)
    return (float(found[1]), found[2]) if found else (None, "")
