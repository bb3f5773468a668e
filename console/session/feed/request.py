"""The schema of a feed, and the one line that a reader may send: how often it wants the state. Pure."""

from __future__ import annotations

import re

SCHEMA = 1
LEAST_HZ, MOST_HZ = 1.0, 10.0
LONGEST_LINE = 100  # bytes, without its end
FORM = f"rate HZ, {LEAST_HZ:g} to {MOST_HZ:g}"
_RATE = re.compile(rb"rate (\d{1,2}(?:\.\d{1,3})?)\r?\n?")


def request_line(hz: float) -> bytes:
    """Return the line that asks for a rate."""
    return f"rate {hz:.3f}\n".encode("ascii")


def asked_hz(line: bytes) -> float | None:
    """Return the rate that a line asks for, the least one for no line; None for any other line."""
    if not line.strip():
        return LEAST_HZ
    found = _RATE.fullmatch(line)
    hz = float(found[1]) if found is not None else 0.0
    return hz if LEAST_HZ <= hz <= MOST_HZ else None
