"""Numbers in sentences and tables: as many digits as their uncertainty bears, true minus signs."""

import math

from stixel_cli.report.metrics import NO_VALUE

MINUS = "\u2212"
_THIN = "\u202f"


def decimals(half: float | None) -> int | None:
    """Decimals, 0 to 3, at which an uncertainty shows two significant digits; None without one."""
    if half is None or not math.isfinite(half) or half <= 0.0:
        return None
    return min(3, max(0, 1 - math.floor(math.log10(half))))


def number(value: float | int | None, places: int | None = None, sign: bool = False) -> str:
    """A number with so many decimals, or else three significant digits; a dash if there is none."""
    if value is None or not math.isfinite(value):
        return NO_VALUE
    if places is None:
        if isinstance(value, int):
            places = 0
        else:
            size = abs(value)
            places = 2 if size == 0.0 else min(4, max(0, 2 - math.floor(math.log10(size))))
    shown = f"{value:+.{places}f}" if sign else f"{value:.{places}f}"
    if not any(digit in shown for digit in "123456789"):
        shown = shown.lstrip("+-")
    return shown.replace("-", MINUS)


def quantity(
    value: float | int | None, unit: str = "", places: int | None = None, sign: bool = False
) -> str:
    """A number with its unit."""
    return _joined(number(value, places, sign), unit)


def with_interval(
    value: float | None, low: float | None, high: float | None, unit: str = "", sign: bool = False
) -> str:
    """A number with its interval in brackets, to the digits that the interval bears."""
    if value is None or low is None or high is None:
        return quantity(value, unit, sign=sign)
    places = decimals(0.5 * (high - low))
    ends = f"[{number(low, places)}, {number(high, places)}]"
    return f"{quantity(value, unit, places, sign)} {ends}"


def percent(share: float | None, places: int = 0) -> str:
    """A share as per cent."""
    return quantity(None if share is None else 100.0 * share, "%", places)


def counted(count: int, what: str) -> str:
    """So many of a thing, whose plural is regular."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def capital(text: str) -> str:
    """The text with a capital letter."""
    return text[:1].upper() + text[1:]


def _joined(shown: str, unit: str) -> str:
    if not unit or shown == NO_VALUE:
        return shown
    return shown + unit if unit == "°" else f"{shown}{_THIN}{unit}"
