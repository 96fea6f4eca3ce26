"""Numbers as text: with the digits that their uncertainty supports, and with a true minus sign."""

import math

from stixel_cli.report.metrics import NO_VALUE

SPREAD = "±"
MINUS = "\u2212"
_THIN = "\u202f"


def decimals(half: float | None) -> int | None:
    """Decimals, 0 to 3, that show two significant digits of an uncertainty; None without one."""
    if half is None or not math.isfinite(half) or half <= 0.0:
        return None
    return min(3, max(0, 1 - math.floor(math.log10(half))))


def number(value: float | int | None, places: int | None = None, sign: bool = False) -> str:
    """A number with the given decimals, by default three significant digits; a dash for None."""
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
    shown = number(value, places, sign)
    if not unit or shown == NO_VALUE:
        return shown
    return shown + unit if unit == "°" else f"{shown}{_THIN}{unit}"


def with_interval(
    value: float | None, low: float | None, high: float | None, unit: str = "", sign: bool = False
) -> str:
    """A number with its interval in brackets, with the digits that the interval supports."""
    if value is None or low is None or high is None:
        return quantity(value, unit, sign=sign)
    places = decimals(0.5 * (high - low))
    ends = f"[{number(low, places)}, {number(high, places)}]"
    return f"{quantity(value, unit, places, sign)} {ends}"


def with_std(value: float | None, std: float | None) -> str:
    """A number with its standard deviation, with the digits that this supports."""
    if value is None or std is None:
        return number(value)
    places = decimals(std)
    # A tiny standard deviation must not add digits to the value.
    most = 3 - math.floor(math.log10(max(abs(value), 1e-3)))
    places = max(0, min(3 if places is None else places, most))
    return f"{number(value, places)} {SPREAD} {number(std, places)}"


def percent(share: float | None, places: int = 0) -> str:
    """A share as per cent."""
    return quantity(None if share is None else 100.0 * share, "%", places)


def counted(count: int, what: str) -> str:
    """A number with its noun, whose plural must be regular."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def capital(text: str) -> str:
    """The text with a capital letter."""
    return text[:1].upper() + text[1:]
