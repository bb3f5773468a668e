"""Position following: a motor follows a master by a ratio, Ix07 to Ix08, like a pair of gears.

Each servo cycle the master's movement in 1/32 count, times Ix07, is added to a register of the motor in 1/(Ix08 x
32) count: integers, so that no remainder is ever lost. Ix07 may change during following without affecting the
distance followed before. There is no ramp: following begins at the master's speed.

The master is a converted position, the encoder conversion table's output for an encoder in each servo cycle: a
24-bit register, five bits of it fraction, that rolls over. Sources: PMAC User Manual, position processing,
position following, encoder conversion table; PMAC and Turbo Software Reference, Ix05 to Ix08; Turbo, I8000.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum, auto

from drivers.pmac.dialect import Dialect
from drivers.pmac.memory import WORD_BITS

COUNT_PARTS = 32  # Resolution of five fraction bits, parts per count

_ADDRESS, _ENABLE, _RATIO, _SCALE = 5, 6, 7, 8
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
            own_teeth=setting(_SCALE),
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
