"""The families of controllers, as data."""

from collections.abc import Mapping

from drivers.pmac.families.family import Dialect, Place, Scope, Setting
from drivers.pmac.families.pmac import PMAC
from drivers.pmac.families.turbo import TURBO

__all__ = ["DIALECTS", "PMAC", "TURBO", "Dialect", "Place", "Scope", "Setting"]

DIALECTS: Mapping[str, Dialect] = {dialect.name: dialect for dialect in (PMAC, TURBO)}
"""By the name that a machine profile or a command line gives."""
