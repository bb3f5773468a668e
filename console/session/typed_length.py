"""A length as an operator types it, in the unit that its field shows: converted once, in decimal digits."""

from __future__ import annotations

from console.session.typed_number import plain_number, typed_number
from console.units import Units


def stored_length(text: str, key: str, limit: str, unit: str, units: Units) -> str:
    """Return what was typed as a number of our unit, exactly; a text that is no number is returned unchanged.

    Raises ProfileError: `value.ambiguous`, see `plain_number`.
    """
    plain = plain_number(text.strip(), key, limit)
    return text if plain is None else units.ours(plain, unit)


def typed_length(text: str, key: str, limit: str, unit: str, units: Units) -> float:
    """Return a typed length in our unit.

    Raises ProfileError: `value.ambiguous` and `value.not_number`, see `typed_number`.
    """
    typed_number(text, key, limit)
    return float(stored_length(text, key, limit, unit, units))
