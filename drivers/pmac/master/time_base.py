"""A master encoder leads: external time base of a coordinate system, and position following of a motor.

Time base: an entry of the encoder conversion table turns the counts of each servo cycle into trajectory time; Ix93
points at it. At the real-time input frequency (RTIF) programmed times are true. All arithmetic is in integers, as
on the controller, so that nothing drifts: the scale factor 131072 / RTIF has to be an integer. Sources: PMAC and
Turbo User Manual, synchronizing to external events; Software Reference, encoder conversion table, Ix93, Ix94;
Turbo I8000.

Position following: a motor follows a master by a ratio, Ix07 to Ix08, like a pair of gears. Each servo cycle the
master's movement in 1/32 count, times Ix07, is added to a register of the motor in 1/(Ix08 x 32) count: integers,
so that no remainder is ever lost. Ix07 may change during following without affecting the distance followed before.
There is no ramp: following begins at the master's speed. The master is a converted position, the encoder
conversion table's output for an encoder in each servo cycle: a 24-bit register, five bits of it fraction, that
rolls over. Sources: PMAC User Manual, position processing, position following, encoder conversion table; PMAC and
Turbo Software Reference, Ix05 to Ix08; Turbo, I8000.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum, auto
from fractions import Fraction

from drivers.pmac.dialect import Dialect
from drivers.pmac.memory import WORD_BITS
from drivers.pmac.settings import I10_PER_MS

UNITS_PER_MS = I10_PER_MS  # Time bases, I10 and Ix94 are in 2^-23 ms

WIDEST_UNITS = (1 << (WORD_BITS - 1)) - 1
"""A time base is a signed 24-bit word: just below 1 ms of trajectory time in a servo cycle."""

FASTEST_SLEW = WIDEST_UNITS  # Ix94 that never limits, so that no master counts are lost
_SCALE = 2**17  # The scale factor times RTIF, counts/ms

COUNT_PARTS = 32  # Resolution of five fraction bits, parts per count

_ADDRESS, _ENABLE, _RATIO, _POSITION_SCALE = 5, 6, 7, 8
"""Ix05 master address, Ix06 enable, Ix07 and Ix08 the teeth of the two gears."""


class FollowingMode(StrEnum):
    """Effect of following on the reported position."""

    OFF = auto()
    NORMAL = auto()
    """It counts as motion of the motor: the next programmed move to an absolute position cancels it."""
    OFFSET = auto()  # It is an offset: programmed moves are superimposed on it


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowingSetup:
    """The settings of a motor; `master` is an address, `teeth` Ix07 and `own_teeth` Ix08.

    `offset` is whether the followed distance is left out of the position, now or when it was followed.
    """

    mode: FollowingMode
    master: int
    teeth: int
    own_teeth: int
    offset: bool = False

    @classmethod
    def of_motor(cls, motor: int, settings: Mapping[int, float], dialect: Dialect) -> FollowingSetup:
        """Read the settings of a motor, I-variables by index; missing ones are 0."""

        def setting(number: int) -> int:
            return int(settings.get(dialect.motor_index(motor, number), 0))

        number, bit = dialect.offset_following
        offset = bool(setting(number) >> bit & 1)
        on = FollowingMode.OFFSET if offset else FollowingMode.NORMAL
        return cls(
            mode=on if setting(_ENABLE) & 1 else FollowingMode.OFF,
            master=setting(_ADDRESS) & dialect.highest_address,
            teeth=setting(_RATIO),
            own_teeth=setting(_POSITION_SCALE),
            offset=offset,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """The distance a motor has followed so far: `followed` in 1/(Ix08 x 32) count, and the master's register."""

    master_parts: int
    followed: int = 0

    def step(self, setup: FollowingSetup, master_parts: int) -> tuple[Following, int]:
        """Advance by a servo cycle; return also the motor's movement in it, in 1/(Ix08 x 32) count.

        `master_parts` is the master's register, 24 bits in 1/32 count, which rolls over.
        """
        turned = register_change(master_parts, self.master_parts)
        increment = 0 if setup.mode is FollowingMode.OFF else setup.teeth * turned
        return replace(self, master_parts=master_parts, followed=self.followed + increment), increment


def parts_of(counts: float) -> int:
    """Return a position in counts as 1/32 counts, rounded down."""
    return int(counts * COUNT_PARTS // 1)


def register_change(new: int, old: int) -> int:
    """Return the change of the register, the shorter way round, 1/32 count."""
    half = 1 << (WORD_BITS - 1)
    return (new - old + half) % (1 << WORD_BITS) - half


def in_counts(parts: int, setup: FollowingSetup) -> float:
    """Return a distance of the motor, 1/(Ix08 x 32) count, in counts; 0 with an Ix08 of 0."""
    return parts / (setup.own_teeth * COUNT_PARTS) if setup.own_teeth else 0.0


_UNITS_PER_PART = UNITS_PER_MS // (_SCALE * COUNT_PARTS)
_UNITS_PER_COUNT = UNITS_PER_MS // _SCALE

TIME_BASE_METHOD = 0x4  # The method digit of an entry that is not triggered
METHOD_SHIFT = 20  # Position of the method digit in a set-up word
_TURBO_MODE = 1 << 19  # In a triggered entry of a Turbo PMAC: the source is a PMAC2-style servo IC

_SOURCE_MASK = _TURBO_MODE - 1

_SOURCE, _SLEW = 93, 94  # Ix93, the time base source, and Ix94, its maximum rate of change


def nearest_factor(counts_per_ms: float) -> int:
    """Return the integer scale factor whose real-time input frequency is nearest to a frequency, counts/ms."""
    below = min(max(1, int(_SCALE / counts_per_ms)), WIDEST_UNITS - 1)
    return min((below, below + 1), key=lambda factor: abs(_SCALE / factor - counts_per_ms))


def real_time_counts_per_ms(factor: int) -> Fraction:
    """Return the frequency at which programmed times are true."""
    return Fraction(_SCALE, factor)


def increment_units(factor: int, master_parts: int) -> int:
    """Return the trajectory time of a servo cycle, 2^-23 ms, for master counts in 1/32; it saturates at 1 ms."""
    return _saturate_units(_UNITS_PER_PART * factor * master_parts)


class TimeBaseTrigger(IntEnum):
    """The three states of a triggered time base: the method digit of its entry in the conversion table."""

    FROZEN = 0x9  # No time passes
    RUNNING = 0xA  # Time passes with the master, after the trigger
    ARMED = 0xB  # No time passes until the trigger comes; then the state is running


@dataclass(frozen=True, slots=True, kw_only=True)
class TriggeredTimeBase:
    """A triggered entry: its state, scale factor, and the master's count in the previous servo cycle.

    The source is the encoder itself, in whole counts, not the converted position.
    """

    state: TimeBaseTrigger
    factor: int
    counts: int = 0

    def step(self, counts: int, captured: int | None = None) -> tuple[TriggeredTimeBase, int]:
        """Advance by a servo cycle that ends with the master at `counts`; return its time, 2^-23 ms, too.

        `captured` is the count at the trigger, if it came in this cycle: time begins exactly there.
        """
        start, state = self.counts, self.state
        if state is TimeBaseTrigger.ARMED and captured is not None:
            start, state = captured, TimeBaseTrigger.RUNNING
        passed = counts - start if state is TimeBaseTrigger.RUNNING else 0
        return replace(self, state=state, counts=counts), _saturate_units(_UNITS_PER_COUNT * self.factor * passed)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeBaseEntry:
    """Two lines of the conversion table, from `line` on (0 is the first).

    `source` is the address of a converted position, or, if `trigger` is not None, of the registers of an encoder.
    """

    line: int
    source: int
    factor: int
    trigger: TimeBaseTrigger | None = None
    pmac2_encoder: bool = False

    def word(self) -> int:
        """The set-up word of the first line; the second one holds the scale factor."""
        method = TIME_BASE_METHOD if self.trigger is None else self.trigger
        mode = _TURBO_MODE if self.trigger is not None and self.pmac2_encoder else 0
        return method << METHOD_SHIFT | mode | self.source

    def address(self, dialect: Dialect) -> int:
        """Return the X address of the time base: the result of the second line."""
        return dialect.conversion_table.first_address + self.line + 1

    def commands(self, dialect: Dialect, system: int = 1) -> list[str]:
        """Return the lines to send; the last one stops Ix94 from limiting, which would lose counts."""
        table = dialect.conversion_table
        source, slew = dialect.system_index(system, _SOURCE), dialect.system_index(system, _SLEW)
        if table.first_setting is None:
            place = table.first_address + self.line
            setup = [f"WY:${place:X},${self.word():X},{self.factor}"]
        else:
            first = table.first_setting + self.line
            setup = [f"I{first}=${self.word():X}", f"I{first + 1}={self.factor}"]
        return [*setup, f"I{source}=${self.address(dialect):X}", f"I{slew}={FASTEST_SLEW}"]


def entry_of(line: int, word: int, factor: int) -> TimeBaseEntry | None:
    """Return the entry that two set-up words make, None when they make no time base."""
    method = word >> METHOD_SHIFT
    source = word & _SOURCE_MASK
    if method == TIME_BASE_METHOD:
        return TimeBaseEntry(line=line, source=source, factor=factor)
    if method not in tuple(TimeBaseTrigger):
        return None
    pmac2 = bool(word & _TURBO_MODE)
    return TimeBaseEntry(
        line=line, source=source, factor=factor, trigger=TimeBaseTrigger(method), pmac2_encoder=pmac2
    )


def _saturate_units(units: int) -> int:
    return max(-WIDEST_UNITS - 1, min(WIDEST_UNITS, units))
