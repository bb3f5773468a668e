"""The watchdog: a countdown timer of the controller that the host keeps from running out.

It is read by the heartbeat PLC, in the background, and by the loop of a cutting program.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.memory import WORD_BITS, Pointer
from drivers.pmac.settings import servo_cycle_ms

WATCHDOG_MS = 300.0  # Watchdog timeout after one renewal
PERIOD_MS = 50.0  # Time between two renewals: five may be lost or late
MARGIN_MS = 20.0  # Remaining time when the PLC acts: with background cycles up to this, 300 ms are kept
SYSTEM = 1  # The coordinate system whose timers are used, where they belong to one; it is always activated
SERVO_PERIOD = 10  # I10: the servo period in 1/8388608 ms


class Activity(IntEnum):
    """What the watchdog guards."""

    NOTHING = 0
    JOG = 1
    CUT = 2


@dataclass(frozen=True, slots=True)
class Timer:
    """A variable that counts down one per servo cycle; `pointer` is its required definition, None: built in."""

    name: str
    pointer: Pointer | None = None


def watchdog_timer(dialect: Dialect, place: int = 0) -> Timer:
    """Return the timer of the watchdog: the first that the family has."""
    if dialect.timer_numbers:
        return Timer(f"I{dialect.system_index(SYSTEM, dialect.timer_numbers[place])}")
    space, address = dialect.timer_words[place]
    pointer = Pointer(space=space, address=address, width=WORD_BITS, signed=True)
    return Timer(f"M{reserved.WATCHDOG_TIMER + place}", pointer)


def wait_timer(dialect: Dialect) -> Timer:
    """Return the timer that the PLC waits by: the second one."""
    return watchdog_timer(dialect, 1)


def cycles_of(time_ms: float, i10: float) -> int:
    """Return the servo cycles that fit into a time; `i10` is the value of I10."""
    return math.floor(time_ms / servo_cycle_ms(i10))


def watchdog_line(dialect: Dialect, i10: float | None = None) -> str:
    """Return the line that renews the watchdog; `i10` is the controller's value, None the factory's."""
    cycles = cycles_of(WATCHDOG_MS, dialect.factory[SERVO_PERIOD] if i10 is None else i10)
    return f"{watchdog_timer(dialect).name}={cycles}"


def watchdog_condition(dialect: Dialect) -> str:
    """Return the loop condition with which a cutting program ends by itself without a host."""
    return f"{watchdog_timer(dialect).name}>0"
