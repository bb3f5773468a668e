"""Numbers for people at a machine: rounded as asked for, and never with an exponent."""

from __future__ import annotations

_DECIMALS = 9
"""Of a number that is too small for the digits that are asked for; what is still smaller is 0."""


class PlainNumber(float):
    """A number whose `g` format writes out what would get an exponent."""

    def __format__(self, spec: str) -> str:
        """Return the number in that format; a large one has all digits that stand before the point."""
        shown = super().__format__(spec)
        if "e" not in shown:
            return shown
        sign = "+" if spec.startswith("+") else ""
        if "e+" in shown:
            return super().__format__(f"{sign}.0f")
        digits = super().__format__(f"{sign}.{_DECIMALS}f").rstrip("0").rstrip(".")
        return "0" if digits in ("0", "-0", "+0") else digits
