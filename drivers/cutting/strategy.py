"""Every strategy there is, registered once, in the order in which they are offered."""

from __future__ import annotations

from enum import StrEnum
from typing import Self

from drivers.cutting.strategies import cam, none, paper, pvt, timebase
from drivers.cutting.strategies.traits import Traits


class Strategy(StrEnum):
    """How the tool is locked to the spindle: its name, with its descriptor as `traits`.

    Nobody compares names: what depends on the strategy is a field of the descriptor.
    """

    traits: Traits

    # The value alone is what a strategy is looked up by.
    def __new__(cls, name: str, traits: Traits | None = None) -> Self:
        """Make a member of its name and its descriptor."""
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
"""What a part is cut with to see what a compensation is worth."""

INVERTING = tuple(each for each in Strategy if each.traits.inverts)
"""Those whose command is the inverse of a response: they follow the path that they are given."""

BY_TABLE = tuple(each for each in Strategy if each.traits.by_table)
TURNED_BY_OTHERS = tuple(each for each in Strategy if each.traits.counts_from is not None)
"""Those that cut on a spindle which the program does not turn."""

TAKING_TS = tuple(each for each in Strategy if each.traits.takes_ts)
TRIMMED = tuple(each for each in Strategy if each.traits.trims)
"""Those that the host may correct within the cut."""
