"""Numbers for people at a machine: rounded as requested, and never with an exponent."""

from __future__ import annotations

_DECIMALS = 9
"""Decimals of a number too small for the requested digits; what is still smaller is 0."""


class PlainNumber(float):
    """Number whose `g` format writes out what would get an exponent."""

    def __format__(self, spec: str) -> str:
        """Return the number in that format; a large one keeps all digits before the point."""
        shown = super().__format__(spec)
        if "e" not in shown:
            return shown
        sign = "+" if spec.startswith("+") else ""
        if "e+" in shown:
            return super().__format__(f"{sign}.0f")
        digits = super().__format__(f"{sign}.{_DECIMALS}f").rstrip("0").rstrip(".")
        return "0" if digits in ("0", "-0", "+0") else digits
