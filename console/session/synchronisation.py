"""Whether tool and spindle keep together: told for each look of a cut that has a lobe to follow."""

from __future__ import annotations

from enum import StrEnum

from console.session.interlocks import SPEED_BAND
from drivers.cutting.plan import Strategy

STANDS_SHARE = 0.05
"""Below this share of the speed of the job a spindle stands."""


class Synchronisation(StrEnum):
    """How tool and spindle are together.

    `queued`: the program runs, but the spindle is not at speed yet or the carriage not at the part. `waiting`: no
    time of the program passes until the index of the spindle comes. `in_sync`: in the part, in phase. `lost`: in
    the part, out of phase or with a spindle that stands.
    """

    QUEUED = "queued"
    WAITING = "waiting"
    IN_SYNC = "in_sync"
    LOST = "lost"


def before_part(
    strategy: Strategy, *, spindle_rpm: float | None, wanted_rpm: float, begun: bool
) -> Synchronisation | None:
    """Return what a program that runs is at, before the part is reached; None where the tool follows no lobe.

    `begun` is whether the tool has left the place where the program found it. Only a program on the spindle's time
    waits for the index, and it waits with everything at rest but the spindle.
    """
    if strategy is Strategy.NONE:
        return None
    at_speed = spindle_rpm is not None and abs(abs(spindle_rpm) - wanted_rpm) <= SPEED_BAND * wanted_rpm
    waits = strategy is Strategy.TIMEBASE and at_speed and not begun
    return Synchronisation.WAITING if waits else Synchronisation.QUEUED


def in_part(
    strategy: Strategy, *, spindle_rpm: float | None, wanted_rpm: float, in_phase: bool | None
) -> Synchronisation | None:
    """Return whether tool and spindle are together in the part; None while that is not known, or without a lobe.

    A spindle that stands is lost whatever the phase: what follows its angle stands with it, in phase.
    """
    if strategy is Strategy.NONE:
        return None
    if spindle_rpm is not None and abs(spindle_rpm) < STANDS_SHARE * wanted_rpm:
        return Synchronisation.LOST
    if in_phase is None:
        return None
    return Synchronisation.IN_SYNC if in_phase else Synchronisation.LOST
