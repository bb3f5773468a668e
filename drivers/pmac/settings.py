"""The I-variable settings of a controller, and the servo time in I10."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from drivers.pmac.dialect import PMAC, Dialect, FamilySetting, SettingScope

I10_PER_MS = 8_388_608  # I10 counts servo time in 2^-23 ms, and wraps there
PARTS_PER_COUNT = 16.0  # Ix11, Ix12, Ix26 and Ix28 are in sixteenths of a count

_FIRST_SYSTEM_NUMBER = 85
"""On the non-Turbo controller Ix85 to Ix98 belong to the coordinate system, lower numbers to the motor."""


def settings_with(named: Mapping[str, float], dialect: Dialect = PMAC) -> dict[int, float]:
    """Return every I-variable: those that are named, such as {"I116": 500}, and factory defaults for the rest.

    The names are those of the non-Turbo controller; each is mapped to its number in the dialect. A number that the
    non-Turbo controller does not have, such as I5187, is the dialect's own.
    """
    return {**dialect.factory, **named_settings(named, dialect)}


def named_settings(named: Mapping[str, float], dialect: Dialect) -> dict[int, float]:
    """Return only the settings that are named, by their numbers in a dialect."""
    return {index: value for name, value in named.items() for index in _places(int(name[1:]), dialect)}


def servo_cycle_ms(i10: float) -> float:
    """Return the servo time that I10 states, ms.

    It has 23 bits and wraps; a 0 would stop the time of every motion, so the least step is used.
    """
    return max(1, int(i10) % I10_PER_MS) / I10_PER_MS


def _places(index: int, dialect: Dialect) -> Iterable[int]:
    """Map a setting of the non-Turbo controller to a dialect; a global one may become one per motor or system."""
    if index > PMAC.highest_index:
        return (index,)
    owner, number = divmod(index, 100)
    for setting, place in PMAC.places.items():
        if place.number == number and (place.scope is SettingScope.GLOBAL) == (owner == 0):
            return _spread(dialect, owner, setting)
    if owner and number >= _FIRST_SYSTEM_NUMBER:
        return (dialect.system_index(owner, number),)
    return (index,)


def _spread(dialect: Dialect, owner: int, setting: FamilySetting) -> Iterable[int]:
    """Map with `owner` 0 for what the non-Turbo controller has once; then all motors or systems get it."""
    owners = (owner,) if owner else dialect.numbers(dialect.places[setting].scope)
    return {dialect.index(setting, each) for each in owners}
