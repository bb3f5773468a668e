"""Gathered data as arrays with units: from the text of LIST GATHER back to counts over milliseconds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.dialect import Dialect
from drivers.pmac.gathering.gather import GatherError, listed_words, long_words_of, unpack
from drivers.pmac.master.following import COUNT_PARTS
from drivers.pmac.memory import Pointer

SCALE_NUMBERS = (8, 9, 60)
"""Ix08 and Ix09: register steps per 1/32 count; Ix60: a velocity spans one cycle more."""

_POSITION_SCALE, _VELOCITY_SCALE, _CYCLE_EXTENSION = SCALE_NUMBERS

_POSITIONS = ("commanded", "actual", "target", "bias", "master", "compensation", "following_error")


@dataclass(frozen=True, slots=True, kw_only=True)
class GatherChannel:
    """One quantity: its register, and `scale` units per step of the register."""

    name: str
    unit: str
    source: Pointer
    scale: float = 1.0


@dataclass(frozen=True, kw_only=True)
class GatheredData:
    """Samples of some channels, by name, in their units; `times_ms` counts from the first sample."""

    times_ms: NDArray[np.float64]
    values: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str]

    @classmethod
    def from_listing(
        cls, lines: Iterable[str], channels: Sequence[GatherChannel], period_cycles: int, cycle_ms: float
    ) -> GatheredData:
        """Parse the lines of LIST GATHER; the channels are those that were gathered, in order.

        Raises:
            GatherError: not such a listing, one that ends inside a sample, or samples without a time between them.
        """
        names = [channel.name for channel in channels]
        if not names or len(set(names)) != len(names):
            raise GatherError(f"channels {', '.join(names)}; one at least, each with a name of its own")
        words = listed_words(lines)
        sources = [channel.source for channel in channels]
        size = long_words_of(sources)
        if len(words) % size:
            cut = f"{len(words)} long words listed, {size} in a sample"
            raise GatherError(f"{cut}: cut off, or not these sources; list once more")
        samples = [unpack(sources, words[first : first + size]) for first in range(0, len(words), size)]
        if len(samples) > 1 and period_cycles < 1:
            raise GatherError(f"{len(samples)} samples at a period of {period_cycles}: nothing says when; from 1")
        columns = np.array(samples, dtype=np.float64).reshape(-1, len(channels)).T
        return cls(
            times_ms=np.arange(len(samples), dtype=np.float64) * (period_cycles * cycle_ms),
            values={
                channel.name: column * channel.scale for channel, column in zip(channels, columns, strict=True)
            },
            units={channel.name: channel.unit for channel in channels},
        )


def motor_channel(quantity: str, motor: int, settings: Mapping[int, float], dialect: Dialect) -> GatherChannel:
    """Return the channel of a motor's register, `commanded`, `actual`, `velocity` ..., as its family names it.

    `settings` are I-variables by index, read back from the controller: Ix08, Ix09 and Ix60 scale the registers.

    Raises:
        GatherError: a register that the family does not have, or one that is neither a position nor the velocity.
    """
    register = dialect.registers.get(quantity)
    if register is None or quantity not in (*_POSITIONS, "velocity"):
        known = ", ".join(name for name in (*_POSITIONS, "velocity") if name in dialect.registers)
        raise GatherError(f"{quantity} of motor {motor} in a {dialect.name}; there are {known}")

    def setting(number: int) -> float:
        return settings.get(dialect.motor_index(motor, number), 0.0)

    position = quantity in _POSITIONS
    number = _POSITION_SCALE if position else _VELOCITY_SCALE
    if setting(number) <= 0:
        raise GatherError(f"I{dialect.motor_index(motor, number)} is {setting(number)}; above 0, read it first")
    steps = setting(number) * COUNT_PARTS * (1 if position else setting(_CYCLE_EXTENSION) + 1)
    return GatherChannel(
        name=f"#{motor} {quantity}",
        unit="counts" if position else "counts/cycle",
        source=Pointer(
            space=register.space,
            address=register.address + (motor - 1) * register.stride,
            signed=register.space in "XY",
        ),
        scale=1.0 / steps,
    )
