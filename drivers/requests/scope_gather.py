"""Gather the channels of a scope: set up, wait for the trigger, start, and fetch in pieces between the polls.

The controller starts by a command alone: a level is looked for in the samples, by this host, in one record after
the other, with a gap between them while one is fetched. Nothing here moves anything. For a worker thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ControllerError, DriverError
from drivers.lathe.lengths import motor_of
from drivers.lathe.snapshot import AxisName
from drivers.pmac.dialect import Dialect
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import SPARE_LONG_WORDS, DataGathering, GatheredData, GatherPlan
from drivers.pmac.language.errors import ErrorCode
from drivers.requests.side_controller import SideController
from profiles.machine import MachineProfile
from profiles.problem import Problem

SLICE_S = 0.02  # between two looks at the newest state
PIECE_POLL_S = 0.06  # a poll longer than this shortens the pieces, as in a cut (`drivers.cutting.sampling`)
MARGIN_S = 0.05
PIECE_TIMEOUT_S = 1.0

Floats = NDArray[np.float64]
MOST_LONG_WORDS = 30_000  # a minute and more of fetching on a serial line; a controller has more memory
FETCH_WORDS_REST, FETCH_WORDS_MOTION, LEAST_WORDS = 256, 24, 4

PERIODS_CYCLES = (1, 2, 5, 10, 20, 50, 100)
LENGTHS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
MOST_CHANNELS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineConditions:
    """What the newest state says. `near_cut`: a cut is loaded and may start; `cutting`: its program runs."""

    now_s: float
    at_rest: bool
    near_cut: bool
    cutting: bool
    round_trip_s: float


@dataclass(frozen=True, slots=True)
class ScopeProgress:
    """`stage` is `waiting`, `setting`, `gathering` or `fetching`; `part` of it is done; `tries` records so far."""

    stage: str
    part: float = 0.0
    tries: int = 0


class MotorRegister(StrEnum):
    """Registers of a motor that can be gathered, by the names of the families' tables."""

    COMMANDED = "commanded"
    ACTUAL = "actual"
    FOLLOWING_ERROR = "following_error"
    VELOCITY = "velocity"
    OUTPUT = "output"
    """What the servo commands the amplifier to give: a voltage. The current itself is not gathered."""


class ScopeTrigger(StrEnum):
    """When the record begins."""

    NOW = "now"
    CUT = "cut"
    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True, order=True)
class Channel:
    """One register of one axis; `key` is its name in files."""

    axis: AxisName
    quantity: MotorRegister

    @property
    def key(self) -> str:
        """Its name, such as `tool.actual`."""
        return f"{self.axis}.{self.quantity}"

    @property
    def si_unit(self) -> str:
        """Its unit in files."""
        if self.quantity is MotorRegister.OUTPUT:
            return "V"
        unit = "rad" if self.axis is AxisName.SPINDLE else "m"
        return f"{unit}/s" if self.quantity is MotorRegister.VELOCITY else unit


CHANNELS = tuple(
    Channel(axis, quantity)
    for axis, quantities in (
        (AxisName.TOOL, tuple(MotorRegister)),
        (AxisName.SPINDLE, (MotorRegister.ACTUAL, MotorRegister.FOLLOWING_ERROR, MotorRegister.VELOCITY)),
        (AxisName.CARRIAGE, (MotorRegister.ACTUAL, MotorRegister.FOLLOWING_ERROR, MotorRegister.VELOCITY)),
    )
    for quantity in quantities
)
ANGLE = Channel(AxisName.SPINDLE, MotorRegister.ACTUAL)


def channel_of(key: str) -> Channel:
    """Return a channel by its name. Raises ValueError: there is none."""
    for each in CHANNELS:
        if each.key == key:
            return each
    raise ValueError(f"no channel {key!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScopeSetup:
    """What is gathered. `level` is in the display unit of `level_of`, for a trigger on a level."""

    channels: tuple[Channel, ...] = (
        Channel(AxisName.TOOL, MotorRegister.COMMANDED),
        Channel(AxisName.TOOL, MotorRegister.ACTUAL),
        Channel(AxisName.TOOL, MotorRegister.FOLLOWING_ERROR),
        ANGLE,
    )
    period_cycles: int = 2
    length_s: float = 0.5
    trigger: ScopeTrigger = ScopeTrigger.NOW
    level: float = 0.0
    level_of: Channel = Channel(AxisName.TOOL, MotorRegister.FOLLOWING_ERROR)

    def samples(self, cycle_ms: float) -> int:
        """Return the number of samples."""
        return max(2, round(self.length_s * 1000.0 / (self.period_cycles * cycle_ms)) + 1)

    def long_words(self, cycle_ms: float, dialect: Dialect) -> int:
        """Return the room that the record takes in the controller."""
        words = sum(1 if dialect.registers[each.quantity].space in "XY" else 2 for each in self.channels)
        return self.samples(cycle_ms) * ((words + 1) // 2)


def si_per_count(channel: Channel, machine: MachineProfile) -> float:
    """Return metres or radians per count of the encoder of an axis, or volts per bit of the output."""
    if channel.quantity is MotorRegister.OUTPUT:
        return machine.tool.v_per_bit
    if channel.axis is AxisName.SPINDLE:
        return 6.283185307179586 / machine.spindle.counts_per_rev
    axis = machine.tool if channel.axis is AxisName.TOOL else machine.carriage
    return 1e-3 / axis.counts_per_mm


_DISPLAY = {  # unit, and how many of it are one SI unit
    (False, MotorRegister.COMMANDED): ("mm", 1e3),
    (False, MotorRegister.ACTUAL): ("mm", 1e3),
    (False, MotorRegister.FOLLOWING_ERROR): ("um", 1e6),
    (False, MotorRegister.VELOCITY): ("mm/s", 1e3),
    (False, MotorRegister.OUTPUT): ("V", 1.0),
    (True, MotorRegister.ACTUAL): ("°", 57.29577951308232),
    (True, MotorRegister.FOLLOWING_ERROR): ("°", 57.29577951308232),
    (True, MotorRegister.VELOCITY): ("rpm", 9.549296585513721),
}


def display_of(channel: Channel) -> tuple[str, float]:
    """Return the unit in which a channel is shown, and how many of it are one SI unit."""
    return _DISPLAY[channel.axis is AxisName.SPINDLE, channel.quantity]


@dataclass(frozen=True, kw_only=True, eq=False)
class ScopeRecord:
    """Samples in SI units, by channel, shape (M,) each; `times_s` counts from the trigger."""

    machine: str
    taken: str
    trigger: ScopeTrigger
    times_s: Floats
    values: dict[Channel, Floats] = field(default_factory=dict)


class Scope:
    """One record of one set-up; `cleaner` is a client of its own, for what must be done after a cancellation."""

    def __init__(
        self,
        client: SideController,
        cleaner: SideController,
        machine: MachineProfile,
        seen: Callable[[], MachineConditions],
        told: Callable[[ScopeProgress], object],
    ) -> None:
        self._client, self._cleaner, self._machine = client, cleaner, machine
        self._seen, self._told = seen, told
        self._gathering = DataGathering(client=client, dialect=client.dialect)
        self._ours = False
        self._tries = 0

    def record(self, setup: ScopeSetup, taken: str) -> ScopeRecord:
        """Return a record; `taken` is the date written into it.

        Raises:
            DriverError: `scope.in_use`, `scope.changed`, `scope.no_room`, `scope.too_long`, `scope.empty`,
                `gather.failed`; or the link.
            CancelledError: it was ended.
        """
        try:
            return self._gather_record(setup, taken)
        except ControllerError as error:
            raise self._refusal(error) from error
        except GatherError as error:
            raise self._gather_error("gather.failed", str(error)) from error
        finally:
            self._give_back()

    def _gather_record(self, setup: ScopeSetup, taken: str) -> ScopeRecord:
        plan: GatherPlan | None = None
        while True:
            self._await_start(setup, loaded=True)
            plan = plan or self._prepare_plan(setup)
            self._await_start(setup, loaded=False)
            data = self._gather_data(plan)
            record = self._in_si(setup, plan, data, taken)
            self._tries += 1
            if setup.trigger not in (ScopeTrigger.RISING, ScopeTrigger.FALLING):
                return record
            place = crossing(record.values[setup.level_of] * display_of(setup.level_of)[1], setup)
            if place is not None:
                return replace(record, times_s=record.times_s - record.times_s[place])

    def _await_start(self, setup: ScopeSetup, *, loaded: bool) -> None:
        """Wait for the cut: until it is loaded, which takes the gather buffer, or until its program runs."""
        if setup.trigger is not ScopeTrigger.CUT:
            return
        while not (self._seen().near_cut if loaded else self._seen().cutting):
            self._sleep("waiting")

    def _prepare_plan(self, setup: ScopeSetup) -> GatherPlan:
        self._told(ScopeProgress("setting", tries=self._tries))
        cycle_ms, dialect = self._machine.controller.servo_period_ms, self._client.dialect
        words = setup.long_words(cycle_ms, dialect)
        if words > MOST_LONG_WORDS:
            raise self._gather_error("scope.too_long", str(words), f"<= {MOST_LONG_WORDS}")
        if not self._ours and self._gathering.running():
            raise self._gather_error("scope.in_use")
        names = [f"#{motor_of(self._machine, each.axis)} {each.quantity}" for each in setup.channels]
        channels = self._gathering.motor_channels(*names)
        plan = self._gathering.prepare(channels, setup.samples(cycle_ms), setup.period_cycles)
        self._ours = True
        return plan

    def _gather_data(self, plan: GatherPlan) -> GatheredData:
        began_s, length_s = self._seen().now_s, plan.duration_ms / 1000.0
        if self._tries:
            self._gathering.start(plan)
        else:  # its buffer was defined a moment ago: one request is one poll sooner
            self._client.request("GATHER")
        began_s = max(began_s, self._seen().now_s)
        while (gone_s := self._seen().now_s - began_s) < length_s + MARGIN_S:
            self._sleep("gathering", gone_s / max(length_s, SLICE_S))
        self._client.request("ENDGATHER")
        lines = self._fetch_lines(plan)
        if not self._gathering.set_up_as(plan):
            self._ours = False
            raise self._gather_error("scope.changed")
        size = plan.long_words // plan.samples
        whole = len(" ".join(lines).split()) // size * size
        words = " ".join(lines).split()[:whole]
        if not words:
            raise self._gather_error("scope.empty")
        return GatheredData.from_listing([" ".join(words)], plan.channels, plan.period_cycles, plan.cycle_ms)

    def _fetch_lines(self, plan: GatherPlan) -> list[str]:
        lines: list[str] = []
        first = 0
        while first < plan.long_words:
            self._told(ScopeProgress("fetching", first / plan.long_words, self._tries))
            count = min(self._piece(), plan.long_words - first)
            part = self._client.question(f"LIST GATHER {first},{count}", PIECE_TIMEOUT_S)
            found = sum(len(line.split()) for line in part)
            lines += part
            first += found
            if found < count:
                break
        return lines

    def _piece(self) -> int:
        """Return how many long words fit between two polls now: on a slow line fewer, as in a cut."""
        seen = self._seen()
        fraction = min(1.0, PIECE_POLL_S / max(seen.round_trip_s, PIECE_POLL_S)) ** 2
        return max(LEAST_WORDS, math.floor(fraction * (FETCH_WORDS_REST if seen.at_rest else FETCH_WORDS_MOTION)))

    def _in_si(self, setup: ScopeSetup, plan: GatherPlan, data: GatheredData, taken: str) -> ScopeRecord:
        per_s = 1000.0 / plan.cycle_ms
        values: dict[Channel, Floats] = {}
        for channel, each in zip(setup.channels, plan.channels, strict=True):
            scale = si_per_count(channel, self._machine)
            values[channel] = data.values[each.name] * (
                scale * per_s if channel.quantity is MotorRegister.VELOCITY else scale
            )
        return ScopeRecord(
            machine=self._machine.name,
            taken=taken,
            trigger=setup.trigger,
            times_s=data.times_ms / 1000.0,
            values=values,
        )

    def _sleep(self, stage: str, part: float = 0.0) -> None:
        self._told(ScopeProgress(stage, min(part, 1.0), self._tries))
        self._client.end_if_cancelled()
        time.sleep(SLICE_S)

    def _give_back(self) -> None:
        """End gathering and delete the buffer, which other work of the controller may need the room of."""
        if not self._ours:
            return
        for line in ("ENDGATHER", "DELETE GATHER"):
            with suppress(DriverError):
                self._cleaner.request(line)
        self._ours = False

    def _refusal(self, error: ControllerError) -> DriverError:
        if error.error_number == ErrorCode.NO_ROOM:
            return self._gather_error("scope.no_room", str(SPARE_LONG_WORDS))
        if self._ours:  # the buffer is gone, or is being filled: somebody else works with it
            self._ours = False
            return self._gather_error("scope.changed")
        return self._gather_error("gather.failed", str(error))

    def _gather_error(self, code: str, value: str = "", limit: str = "") -> DriverError:
        return DriverError(Problem(code=code, where=self._client.link.address, value=value, limit=limit))


def crossing(values: Floats, setup: ScopeSetup) -> int | None:
    """Return the first sample at which the values have crossed the level in the direction, None where none has."""
    beyond = values > setup.level if setup.trigger is ScopeTrigger.RISING else values < setup.level
    places = np.flatnonzero(beyond[1:] & ~beyond[:-1])
    return int(places[0]) + 1 if places.size else None
