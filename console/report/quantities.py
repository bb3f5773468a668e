"""Values with their units, as the report writes them: rounded for reading only, judged unrounded."""

from __future__ import annotations

import math
from datetime import datetime, tzinfo

UM_DIGITS, MM_DIGITS, DEG_DIGITS = 3, 4, 2
"""Digits behind the point: of roundness in um, of diameters in mm, of angles in deg."""

MOST_DIGITS = 12
MOST_TYPED = 9  # signs of a number that somebody types
NOTHING = "–"


def number(value: object, digits: int) -> str:
    """Return a number with a fixed count of digits; a dash for what is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return NOTHING
    return f"{value:z.{digits}f}"


def with_unit(value: object, digits: int, unit: str) -> str:
    """Return a number with its unit; a dash for what is none."""
    shown = number(value, digits)
    return shown if shown == NOTHING else f"{shown} {unit}"


def um(value: object) -> str:
    """Return a length in um."""
    return with_unit(value, UM_DIGITS, "µm")


def mm(value: object) -> str:
    """Return a diameter or radius in mm."""
    return with_unit(value, MM_DIGITS, "mm")


def exact(value: float, unit: str = "") -> str:
    """Return a number as it was typed, with its unit; one that was computed has more digits, and is rounded."""
    shown = f"{value:.12g}"
    if len(shown) > MOST_TYPED:
        shown = f"{value:.4g}" if abs(value) < 1.0 else f"{value:.4f}"
    return f"{shown}{'' if unit in ('', '°') else ' '}{unit}"


def against_limit(value: float, limit: float) -> tuple[str, str]:
    """Return a value and its upper limit, um, with as many digits as show which of the two is larger."""
    for digits in range(UM_DIGITS, MOST_DIGITS):
        if (round(value, digits) <= round(limit, digits)) == (value <= limit):
            break
    return f"{value:z.{digits}f}", f"{limit:z.{digits}f}"


def date_in(zone: tzinfo | None, at: datetime) -> str:
    """Return a date to the second with its offset from UTC; in the time zone of this computer without `zone`."""
    shown = _local(zone, at)
    return NOTHING if shown is None else f"{shown:%Y-%m-%d %H:%M:%S} UTC{shown.isoformat()[-6:]}"


def time_in(zone: tzinfo | None, at: datetime, begun: datetime) -> str:
    """Return the time of a date, to 0.1 s; with its day where that is not the day on which the run began."""
    shown, first = _local(zone, at), _local(zone, begun)
    if shown is None:
        return NOTHING
    day = "" if first is not None and shown.date() == first.date() else f"{shown:%Y-%m-%d} "
    return f"{day}{shown:%H:%M:%S}.{shown.microsecond // 100_000}"


def _local(zone: tzinfo | None, at: datetime) -> datetime | None:
    """Return a date in a time zone; None of the beginning of time, which stands for a damaged date."""
    try:
        return at.astimezone(zone) if at.year > 1 else None
    except (OverflowError, ValueError, OSError):
        return None
