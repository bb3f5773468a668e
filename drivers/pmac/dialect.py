"""The families of controllers, as data."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.pmac.families.family import Dialect, FamilySetting, SettingPlace, SettingScope
from drivers.pmac.families.pmac import PMAC
from drivers.pmac.families.turbo import TURBO

__all__ = ["DIALECTS", "PMAC", "TURBO", "Dialect", "FamilySetting", "SettingPlace", "SettingScope"]

DIALECTS: Mapping[str, Dialect] = {dialect.name: dialect for dialect in (PMAC, TURBO)}
"""Families by the name that a machine profile or a command line uses."""


def dialect_of(kind: str) -> Dialect | None:
    """Return the family of a controller from its reply to TYPE, None when it is neither."""
    return next((each for each in DIALECTS.values() if kind.strip().startswith(each.type_prefix)), None)
