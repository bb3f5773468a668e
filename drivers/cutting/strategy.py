"""The registry of strategies, in the order in which they are offered."""

from __future__ import annotations

from enum import StrEnum
from typing import Self

from drivers.cutting.strategies import cam, none, paper, pvt, timebase
from drivers.cutting.strategies.traits import Traits


class Strategy(StrEnum):
    """How the tool is synchronised with the spindle: its name, with its descriptor as `traits`.

    Names are never compared: whatever depends on the strategy is a field of the descriptor.
    """

    traits: Traits

    # Strategies are looked up by value alone.
    def __new__(cls, name: str, traits: Traits | None = None) -> Self:
        """Make a member from its name and its descriptor."""
        assert traits is not None
        member = str.__new__(cls, name)
        member._value_ = name
        member.traits = traits
        return member

    PVT = "pvt", pvt.TRAITS
    CAM = "cam", cam.TRAITS
    TIMEBASE = "timebase", timebase.TRAITS
    PAPER = "paper", paper.TRAITS
    NONE = "none", none.TRAITS


DEFAULT_STRATEGY = Strategy.PVT
UNCOMPENSATED = Strategy.NONE
"""The reference cut, to show the benefit of a compensation."""

INVERTING = tuple(each for each in Strategy if each.traits.inverts)
"""Strategies whose command is the inverse of a response: they follow the path that they are given."""

BY_TABLE = tuple(each for each in Strategy if each.traits.by_table)
TURNED_BY_OTHERS = tuple(each for each in Strategy if each.traits.counts_from is not None)
"""Strategies that cut on a spindle which the program does not turn."""

TAKING_TS = tuple(each for each in Strategy if each.traits.takes_ts)
TRIMMED = tuple(each for each in Strategy if each.traits.trims)
"""Strategies that the host may correct within the cut."""
