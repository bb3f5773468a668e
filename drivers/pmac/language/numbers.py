"""Numbers as text that a controller accepts: decimals, and never an exponent."""

from __future__ import annotations

from decimal import Decimal

DECIMALS = 10  # Maximum decimals that `format_number` writes


def format_number(value: float) -> str:
    """Format a number rounded to 10 decimals: never an exponent, a trailing zero or `-0`."""
    if value % 1.0 == 0.0:
        return str(int(value))  # most of the thousands of values that a host may query at once
    return _plain(f"{value:.{DECIMALS}f}")


def format_constant(value: float) -> str:
    """Format a number with as many decimals as it takes to read the same number back; no exponent."""
    short = format_number(value)
    return short if float(short) == value else _plain(f"{Decimal(repr(float(value))):f}")


def _plain(digits: str) -> str:
    if "." in digits:
        digits = digits.rstrip("0").rstrip(".")
    return "0" if digits == "-0" else digits
