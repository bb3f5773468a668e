"""By how much a running cut may be changed: known before it is armed, and shown with every moment of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

REAL_TIME = 100  # percent


class Adjustable(StrEnum):
    """What may be changed in a running cut."""

    OVERRIDE = "override"
    GAIN = "gain"
    PHASE = "phase"


STEPS = {Adjustable.OVERRIDE: 1, Adjustable.GAIN: 1, Adjustable.PHASE: 0.5}
"""One step of each: percent, percent, degrees of spindle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trim:
    """What is added to the compensation: percent of its gain, and degrees of spindle by which it comes later."""

    gain_percent: float = 0.0
    phase_deg: float = 0.0


UNTRIMMED = Trim()


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """By how much a cut may be changed while it runs; `no_override` and `no_trim` are codes of why not at all.

    The override of spindle and feed together is in whole percent; `low_by` and `high_by` name what bounds it. The
    trim is bounded either way: whole percent, and degrees of spindle.
    """

    low_percent: int = REAL_TIME
    high_percent: int = REAL_TIME
    low_by: str = ""
    high_by: str = ""
    no_override: str = "cut.no_override"
    gain_percent: int = 0
    phase_deg: float = 0.0
    no_trim: str = "cut.no_trim"

    def range_of(self, what: Adjustable) -> tuple[float, float]:
        """Return the lowest and the highest value."""
        match what:
            case Adjustable.OVERRIDE:
                return self.low_percent, self.high_percent
            case Adjustable.GAIN:
                return -self.gain_percent, self.gain_percent
            case Adjustable.PHASE:
                return -self.phase_deg, self.phase_deg

    def refusal_code(self, what: Adjustable) -> str:
        """Return the code of why this cannot be changed at all, empty where it can."""
        low, high = self.range_of(what)
        if low < high:
            return ""
        return self.no_override if what is Adjustable.OVERRIDE else self.no_trim


UNCHANGEABLE = Bounds()


@dataclass(frozen=True, slots=True, kw_only=True)
class CutAdjustment:
    """What was commanded of a running cut, `applied` the trim that the controller reports to be in its path."""

    override_percent: int = REAL_TIME
    trim: Trim = UNTRIMMED
    applied: Trim = UNTRIMMED
    bounds: Bounds = UNCHANGEABLE

    def value_of(self, what: Adjustable) -> float:
        """Return what was commanded."""
        match what:
            case Adjustable.OVERRIDE:
                return self.override_percent
            case Adjustable.GAIN:
                return self.trim.gain_percent
            case Adjustable.PHASE:
                return self.trim.phase_deg


AS_PLANNED = CutAdjustment()


@dataclass(frozen=True, slots=True, kw_only=True)
class CutChange:
    """What a cut that was changed had in the end, and from where on it was, mm behind the face of the part."""

    override_percent: int
    trim: Trim
    from_mm: float
