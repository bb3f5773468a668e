"""A number as an operator types it, with a decimal point or comma. What could mean two numbers is refused.

A length is typed in the unit that its field shows, and converted once, in decimal digits.
"""

from __future__ import annotations

import re

from console.units import Units
from profiles.problem import Problem, ProfileError
from profiles.trace_files.number_marks import number_readings

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")


def plain_number(text: str, key: str, limit: str) -> str | None:
    """Return a typed number with a point, None for a text that is no number. `limit` is what is allowed, as text.

    Raises ProfileError: `value.ambiguous`, for "1,234" and "1.234.5" alike.
    """
    # The point is the decimal sign of the screens. A comma, or a second mark, could separate thousands.
    if text.count(".") + text.count(",") > 1 or ("," in text and len(number_readings(text)) > 1):
        raise ProfileError(Problem(code="value.ambiguous", key=key, value=text, limit=limit))
    plain = text.replace(",", ".")
    return plain if _NUMBER.fullmatch(plain) else None


def typed_number(text: str, key: str, limit: str) -> float:
    """Return a typed number.

    Raises ProfileError: `value.ambiguous`, see `plain_number`; `value.not_number`.
    """
    plain = plain_number(text.strip(), key, limit)
    if plain is None:
        raise ProfileError(Problem(code="value.not_number", key=key, value=text.strip(), limit=limit))
    return float(plain)


def stored_length(text: str, key: str, limit: str, unit: str, units: Units) -> str:
    """Return what was typed as a number of our unit, exactly; a text that is no number is returned unchanged.

    Raises ProfileError: `value.ambiguous`, see `plain_number`.
    """
    plain = plain_number(text.strip(), key, limit)
    return text if plain is None else units.to_own_unit(plain, unit)


def typed_length(text: str, key: str, limit: str, unit: str, units: Units) -> float:
    """Return a typed length in our unit.

    Raises ProfileError: `value.ambiguous` and `value.not_number`, see `typed_number`.
    """
    typed_number(text, key, limit)
    return float(stored_length(text, key, limit, unit, units))
