"""A data gathering client: sets up the controller, starts and stops gathering, fetches data. Nothing moves.

Channels are scaled by the controller's own settings. The gathering set-up is read back before the start and before
the listing: another client may have changed it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.controller import REPLY_TIMEOUT_S, Controller, query_in_lines
from drivers.errors import ControllerError
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import number_of
from drivers.pmac.gathering.gather import GatherError, gather_settings, listed_words, long_words_of, unpack
from drivers.pmac.language.errors import ErrorCode
from drivers.pmac.master.time_base import COUNT_PARTS
from drivers.pmac.memory import Pointer
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.status import decode

SPARE_LONG_WORDS = 48
"""Reserved beyond the samples: a controller may store something of its own in the buffer (clients leave 47)."""

LONGEST_PERIOD_CYCLES = 8_388_607

LONG_WORDS_A_REQUEST = 256  # Long words listed at a time: a second of a serial line at 38 400 baud

LISTING_TIMEOUT_S = 10.0

_SERVO_TIME = 10
_OPEN = ("motion_buffer_open", "plc_buffer_open", "rotary_open")
_CHANNEL = re.compile(r"#?(\d+) +(\w+)")
_SETTINGS_A_LINE = 12
"""Settings that fit into one line of the client, whatever their values."""

SCALE_NUMBERS = (8, 9, 60)  # Ix08 and Ix09: register steps per 1/32 count; Ix60: a velocity spans one cycle more

_POSITION_SCALE, _VELOCITY_SCALE, _CYCLE_EXTENSION = SCALE_NUMBERS

_POSITIONS = ("commanded", "actual", "target", "bias", "master", "compensation", "following_error")
_OUTPUT, OUTPUT_BIT = "output", 256  # 16 bits in the upper part of a word of 24


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
            values={each.name: column * each.scale for each, column in zip(channels, columns, strict=True)},
            units={channel.name: channel.unit for channel in channels},
        )


def motor_channel(quantity: str, motor: int, settings: Mapping[int, float], dialect: Dialect) -> GatherChannel:
    """Return the channel of a motor's register, `commanded`, `actual`, `velocity` ..., as its family names it.

    `settings` are I-variables by index, read back from the controller: Ix08, Ix09 and Ix60 scale the registers.

    Raises:
        GatherError: a register that the family does not have, or one that is no position, velocity or output.
    """
    register = dialect.registers.get(quantity)
    if register is None or quantity not in (*_POSITIONS, "velocity", _OUTPUT):
        known = ", ".join(name for name in (*_POSITIONS, "velocity", _OUTPUT) if name in dialect.registers)
        raise GatherError(f"{quantity} of motor {motor} in a {dialect.name}; there are {known}")

    address = register.address + (motor - 1) * register.stride
    source = Pointer(space=register.space, address=address, signed=register.space in "XY")
    if quantity == _OUTPUT:
        return GatherChannel(name=f"#{motor} {quantity}", unit="DAC bits", source=source, scale=1.0 / OUTPUT_BIT)

    def setting(number: int) -> float:
        return settings.get(dialect.motor_index(motor, number), 0.0)

    position = quantity in _POSITIONS
    number = _POSITION_SCALE if position else _VELOCITY_SCALE
    if setting(number) <= 0:
        raise GatherError(f"I{dialect.motor_index(motor, number)} is {setting(number)}; above 0, read it first")
    steps = setting(number) * COUNT_PARTS * (1 if position else setting(_CYCLE_EXTENSION) + 1)
    unit = "counts" if position else "counts/cycle"
    return GatherChannel(name=f"#{motor} {quantity}", unit=unit, source=source, scale=1.0 / steps)


@dataclass(frozen=True, slots=True, kw_only=True)
class GatherPlan:
    """The gathering set-up: `samples` of the channels, one every `period_cycles` servo cycles."""

    channels: tuple[GatherChannel, ...]
    samples: int
    period_cycles: int
    cycle_ms: float

    @property
    def long_words(self) -> int:
        """Number of long words in the samples."""
        return self.samples * long_words_of([channel.source for channel in self.channels])

    @property
    def duration_ms(self) -> float:
        """Time from the first sample to the last one."""
        return (self.samples - 1) * self.period_cycles * self.cycle_ms


@dataclass(frozen=True, slots=True, kw_only=True)
class DataGathering:
    """The data gathering of the controller at the other end of a client; replies must come within `timeout_s`.

    Every method raises DriverError when the controller refuses or does not reply, and GatherError for a reply that
    makes no sense.
    """

    client: Controller
    dialect: Dialect
    timeout_s: float = REPLY_TIMEOUT_S

    def motor_channels(self, *names: str) -> tuple[GatherChannel, ...]:
        """Return channels by names such as `#1 actual`, scaled by the controller's settings.

        Raises GatherError: no such motor or register, or a scale of 0.
        """
        target = []
        for name in names:
            found = _CHANNEL.fullmatch(name.strip())
            if found is None or not 1 <= int(found[1]) <= self.dialect.motor_count:
                raise GatherError(f"channel {name!r}; as in '#1 actual', motors 1 to {self.dialect.motor_count}")
            target.append((int(found[1]), found[2]))
        index = self.dialect.motor_index
        motors = sorted({motor for motor, _ in target})
        settings = self._read(index(motor, number) for motor in motors for number in SCALE_NUMBERS)
        return tuple(motor_channel(quantity, motor, settings, self.dialect) for motor, quantity in target)

    def prepare(self, channels: Sequence[GatherChannel], samples: int, period_cycles: int = 1) -> GatherPlan:
        """Set up gathering and reserve the buffer; its previous content is lost.

        Raises GatherError: gathering is already active, or a program is being entered; an invalid plan, or no room
        for it; settings that the controller does not keep.
        """
        if samples < 1 or not 1 <= period_cycles <= LONGEST_PERIOD_CYCLES:
            detail = f"{samples} samples every {period_cycles} servo cycles"
            raise GatherError(f"{detail}; from 1 sample on, 1 to {LONGEST_PERIOD_CYCLES} cycles")
        settings = gather_settings([channel.source for channel in channels], period_cycles, self.dialect)
        status = self._status()
        if "gathering" in status:
            raise GatherError(f"{self._address}: somebody gathers already; wait for the end, or stop() it first")
        if not status.isdisjoint(_OPEN):  # settings would become lines of that program
            raise GatherError(f"{self._address}: a program is being entered; CLOSE it first")
        texts = [f"I{index}={value}" for index, value in settings.items()]
        for first in range(0, len(texts), _SETTINGS_A_LINE):
            self.client.request(" ".join(texts[first : first + _SETTINGS_A_LINE]))
        cycle_ms = servo_cycle_ms(self._read([_SERVO_TIME])[_SERVO_TIME])
        plan = GatherPlan(
            channels=tuple(channels), samples=samples, period_cycles=period_cycles, cycle_ms=cycle_ms
        )
        self._confirm(plan)
        self._reserve(plan)
        return plan

    def start(self, plan: GatherPlan) -> None:
        """Start with the next servo cycle, in an empty buffer. Raises GatherError: no room any more."""
        self._reserve(plan)  # nothing else resets a controller to the start of its buffer
        self.client.request("GATHER", self.timeout_s)

    def stop(self) -> None:
        """Stop gathering; the data stay, to be fetched."""
        self.client.request("ENDGATHER", self.timeout_s)

    def running(self) -> bool:
        """Whether the controller is gathering."""
        return "gathering" in self._status()

    def set_up_as(self, plan: GatherPlan) -> bool:
        """Whether the controller is still set up to gather according to the plan, in one query."""
        target = gather_settings([channel.source for channel in plan.channels], plan.period_cycles, self.dialect)
        texts = self.client.query(*(f"I{index}" for index in target), timeout_s=self.timeout_s)
        return all(self._number(index, text) == target[index] for index, text in zip(target, texts, strict=True))

    def fetch(self, plan: GatherPlan) -> GatheredData:
        """Return the gathered data, at most the samples of the plan; fewer if it was stopped before.

        Raises GatherError: it is still active, another client has changed the set-up, or a damaged listing.
        """
        if self.running():
            raise GatherError(f"{self._address}: not at its end yet; {plan.duration_ms:.0f} ms, or stop() it")
        self._confirm(plan)
        lines: list[str] = []
        for first in range(0, plan.long_words, LONG_WORDS_A_REQUEST):
            count = min(LONG_WORDS_A_REQUEST, plan.long_words - first)
            part = self.client.request(f"LIST GATHER {first},{count}", LISTING_TIMEOUT_S)
            lines += part
            if sum(len(line.split()) for line in part) < count:
                break
        return GatheredData.from_listing(lines, plan.channels, plan.period_cycles, plan.cycle_ms)

    @property
    def _address(self) -> str:
        return self.client.link.address

    def _status(self) -> frozenset[str]:
        (digits,) = self.client.query("???")
        try:
            return decode(digits, self.dialect.global_bits)
        except ValueError as error:
            raise GatherError(f"{self._address}: ???: {error}; is it a {self.dialect.name}?") from error

    def _confirm(self, plan: GatherPlan) -> None:
        """Check that the controller is set up according to the plan."""
        target = gather_settings([channel.source for channel in plan.channels], plan.period_cycles, self.dialect)
        found = self._read([*target, _SERVO_TIME])
        for index, value in target.items():
            if found[index] != value:
                detail = f"{self._address}: I{index} is {found[index]:g}, {value} was set"
                raise GatherError(f"{detail}; somebody else sets up gathering: start over when it is done")
        if servo_cycle_ms(found[_SERVO_TIME]) != plan.cycle_ms:
            raise GatherError(f"{self._address}: I10 is {found[_SERVO_TIME]:g}, it was changed; start over")
        scaled = [channel for channel in plan.channels if _CHANNEL.fullmatch(channel.name)]
        for channel, now in zip(scaled, self.motor_channels(*(each.name for each in scaled)), strict=True):
            if now.scale != channel.scale:
                detail = (
                    f"{self._address}: {channel.name} has {1 / now.scale:g} steps a {now.unit.split('/')[0]} now"
                )
                raise GatherError(f"{detail}, {1 / channel.scale:g} before; Ix08 or Ix09 was changed: start over")

    def _reserve(self, plan: GatherPlan) -> None:
        long_words = plan.long_words + SPARE_LONG_WORDS
        try:
            self.client.request(f"DEFINE GATHER {long_words}", self.timeout_s)
        except ControllerError as error:
            if error.error_number != ErrorCode.NO_ROOM:
                raise
            detail = f"{self._address}: no room for {long_words} long words (SIZE tells how many there are)"
            raise GatherError(f"{detail}; fewer channels, or fewer samples at a longer period") from error

    def _read(self, indices: Iterable[int]) -> Mapping[int, float]:
        """Return I-variables, parsed in any form of I9."""
        asked = list(indices)
        texts = query_in_lines(self.client, [f"I{index}" for index in asked], _SETTINGS_A_LINE)
        return {index: self._number(index, text) for index, text in zip(asked, texts, strict=True)}

    def _number(self, index: int, text: str) -> float:
        try:
            return number_of(text)
        except ValueError as error:
            raise GatherError(f"{self._address}: I{index} is {text!r}, no number; read it again") from error
