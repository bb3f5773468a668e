"""A data gathering client: sets up the controller, starts and stops gathering, fetches data. Nothing moves.

Channels are scaled by the controller's own settings. The gathering set-up is read back before the start and before
the listing: another client may have changed it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drivers.controller import REPLY_TIMEOUT_S, Controller
from drivers.errors import ControllerError
from drivers.pmac.dialect import Dialect
from drivers.pmac.gathering.gather import GatherError, gather_settings, long_words_of
from drivers.pmac.gathering.gathered_data import SCALE_NUMBERS, GatherChannel, GatheredData, motor_channel
from drivers.pmac.language.errors import ErrorCode
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.status import decode

SPARE_LONG_WORDS = 48
"""Reserved beyond the samples: a controller may store something of its own in the buffer (clients leave 47)."""

LONGEST_PERIOD_CYCLES = 8_388_607

LONG_WORDS_A_REQUEST = 256
"""Long words listed at a time: a second of a serial line at 38 400 baud."""

LISTING_TIMEOUT_S = 10.0

_SERVO_TIME = 10
_OPEN = ("motion_buffer_open", "plc_buffer_open", "rotary_open")
_CHANNEL = re.compile(r"#?(\d+) +(\w+)")
_SETTINGS_A_LINE = 12
"""Settings that fit into one line of the client, whatever their values."""


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
    """The data gathering of the controller at the other end of a client; replies must come within `timeout_s`."""

    client: Controller
    dialect: Dialect
    timeout_s: float = REPLY_TIMEOUT_S

    def motor_channels(self, *names: str) -> tuple[GatherChannel, ...]:
        """Return channels by names such as `#1 actual`, scaled by the controller's settings.

        Raises:
            GatherError: no such motor or register, or a scale of 0.
            DriverError: the controller does not reply, or not with numbers.
        """
        target = [self._motor_and_quantity(name) for name in names]
        index = self.dialect.motor_index
        motors = sorted({motor for motor, _ in target})
        settings = self._read(index(motor, number) for motor in motors for number in SCALE_NUMBERS)
        return tuple(motor_channel(quantity, motor, settings, self.dialect) for motor, quantity in target)

    def prepare(self, channels: Sequence[GatherChannel], samples: int, period_cycles: int = 1) -> GatherPlan:
        """Set up gathering and reserve the buffer; its previous content is lost.

        Raises:
            GatherError: gathering is already active, or a program is being entered; an invalid plan, or no room
            for it;
                settings that the controller does not keep.
            DriverError: the controller refuses, or does not reply.
        """
        if samples < 1 or not 1 <= period_cycles <= LONGEST_PERIOD_CYCLES:
            met = f"{samples} samples every {period_cycles} servo cycles"
            raise GatherError(f"{met}; from 1 sample on, 1 to {LONGEST_PERIOD_CYCLES} cycles")
        settings = gather_settings([channel.source for channel in channels], period_cycles, self.dialect)
        self._refuse_busy()
        texts = [f"I{index}={value}" for index, value in settings.items()]
        for first in range(0, len(texts), _SETTINGS_A_LINE):
            self.client.request(" ".join(texts[first : first + _SETTINGS_A_LINE]))
        plan = GatherPlan(
            channels=tuple(channels),
            samples=samples,
            period_cycles=period_cycles,
            cycle_ms=servo_cycle_ms(self._read([_SERVO_TIME])[_SERVO_TIME]),
        )
        self._confirm(plan)
        self._reserve(plan)
        return plan

    def start(self, plan: GatherPlan) -> None:
        """Start with the next servo cycle, in an empty buffer.

        Raises:
            GatherError: no room any more.
            DriverError: the controller refuses, because gathering is active, or does not reply.
        """
        self._reserve(plan)  # nothing else resets a controller to the start of its buffer
        self.client.request("GATHER", self.timeout_s)

    def stop(self) -> None:
        """Stop gathering; the data stay, to be fetched.

        Raises DriverError: the controller does not reply.
        """
        self.client.request("ENDGATHER", self.timeout_s)

    def running(self) -> bool:
        """Whether the controller is gathering.

        Raises:
            GatherError: its status is invalid.
            DriverError: it does not reply.
        """
        return "gathering" in self._status()

    def set_up_as(self, plan: GatherPlan) -> bool:
        """Whether the controller is still set up to gather according to the plan, in one query.

        Raises:
            GatherError: a reply that is not a number.
            DriverError: the controller does not reply.
        """
        target = gather_settings([channel.source for channel in plan.channels], plan.period_cycles, self.dialect)
        texts = self.client.query(*(f"I{index}" for index in target), timeout_s=self.timeout_s)
        return all(self._number(index, text) == target[index] for index, text in zip(target, texts, strict=True))

    def fetch(self, plan: GatherPlan) -> GatheredData:
        """Return the gathered data, at most the samples of the plan; fewer if it was stopped before.

        Raises:
            GatherError: it is still active, another client has changed the set-up, or a damaged listing.
            DriverError: the controller refuses, because there are no data, or does not reply.
        """
        if self.running():
            raise GatherError(f"{self._where}: not at its end yet; {plan.duration_ms:.0f} ms, or stop() it")
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
    def _where(self) -> str:
        return self.client.link.address

    def _motor_and_quantity(self, name: str) -> tuple[int, str]:
        found = _CHANNEL.fullmatch(name.strip())
        if found is None or not 1 <= int(found[1]) <= self.dialect.motor_count:
            raise GatherError(f"channel {name!r}; as in '#1 actual', motors 1 to {self.dialect.motor_count}")
        return int(found[1]), found[2]

    def _status(self) -> frozenset[str]:
        (digits,) = self.client.query("???")
        try:
            return decode(digits, self.dialect.global_bits)
        except ValueError as error:
            raise GatherError(f"{self._where}: ???: {error}; is it a {self.dialect.name}?") from error

    def _refuse_busy(self) -> None:
        """Refuse while a program is being entered: settings would become lines of it."""
        status = self._status()
        if "gathering" in status:
            raise GatherError(f"{self._where}: somebody gathers already; wait for the end, or stop() it first")
        if not status.isdisjoint(_OPEN):
            raise GatherError(f"{self._where}: a program is being entered; CLOSE it first")

    def _confirm(self, plan: GatherPlan) -> None:
        """Check that the controller is set up according to the plan."""
        target = gather_settings([channel.source for channel in plan.channels], plan.period_cycles, self.dialect)
        found = self._read([*target, _SERVO_TIME])
        for index, value in target.items():
            if found[index] != value:
                met = f"{self._where}: I{index} is {found[index]:g}, {value} was set"
                raise GatherError(f"{met}; somebody else sets up gathering: begin anew when it is done")
        if servo_cycle_ms(found[_SERVO_TIME]) != plan.cycle_ms:
            raise GatherError(f"{self._where}: I10 is {found[_SERVO_TIME]:g}, it was changed; begin anew")
        scaled = [channel for channel in plan.channels if _CHANNEL.fullmatch(channel.name)]
        for channel, now in zip(scaled, self.motor_channels(*(each.name for each in scaled)), strict=True):
            if now.scale != channel.scale:
                met = f"{self._where}: {channel.name} has {1 / now.scale:g} steps a {now.unit.split('/')[0]} now"
                raise GatherError(f"{met}, {1 / channel.scale:g} before; Ix08 or Ix09 was changed: begin anew")

    def _reserve(self, plan: GatherPlan) -> None:
        long_words = plan.long_words + SPARE_LONG_WORDS
        try:
            self.client.request(f"DEFINE GATHER {long_words}", self.timeout_s)
        except ControllerError as error:
            if error.error_number != ErrorCode.NO_ROOM:
                raise
            met = f"{self._where}: no room for {long_words} long words (SIZE tells how many there are)"
            raise GatherError(f"{met}; fewer channels, or fewer samples at a longer period") from error

    def _read(self, indices: Iterable[int]) -> Mapping[int, float]:
        """Return I-variables, parsed in any form of I9."""
        asked = list(indices)
        found: dict[int, float] = {}
        for first in range(0, len(asked), _SETTINGS_A_LINE):
            part = asked[first : first + _SETTINGS_A_LINE]
            texts = self.client.query(*(f"I{index}" for index in part))
            found.update({index: self._number(index, text) for index, text in zip(part, texts, strict=True)})
        return found

    def _number(self, index: int, text: str) -> float:
        digits = text.strip().removeprefix(f"I{index}=")
        try:
            return float(int(digits[1:], 16)) if digits.startswith("$") else float(digits)
        except ValueError as error:
            raise GatherError(f"{self._where}: I{index} is {text!r}, no number; read it again") from error
