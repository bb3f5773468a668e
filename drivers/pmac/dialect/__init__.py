"""The families of controllers, as data."""

from collections.abc import Mapping

from drivers.pmac.dialect.family import Dialect, Place, Scope, Setting
from drivers.pmac.dialect.pmac import PMAC
from drivers.pmac.dialect.turbo import TURBO

__all__ = ["DIALECTS", "PMAC", "TURBO", "Dialect", "Place", "Scope", "Setting"]

DIALECTS: Mapping[str, Dialect] = {dialect.name: dialect for dialect in (PMAC, TURBO)}
"""By the name that a machine profile or a command line gives."""
