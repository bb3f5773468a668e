"""Read the state of a controller's heartbeat, with one renewal to see the timer count."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.errors import ControllerError
from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat import registers
from drivers.pmac.heartbeat.registers import definitions
from drivers.pmac.heartbeat.watchdog import SERVO_PERIOD, watchdog_line, watchdog_timer
from drivers.pmac.language.errors import ErrorCode
from profiles.machine import MachineProfile

PERMISSION = 5  # I5: which PLCs may run

BETWEEN_PULSES_S = 0.1
"""Time between the two polls of echo and timer: several background cycles, and well within the timeout."""

LIST_TIMEOUT_S = 10.0  # Timeout for the whole text over a slow line

ITEMS_PER_LINE = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """The echo of the PLC and the timer, read in one request between two times of the host."""

    asked_s: float
    answered_s: float
    echo: float
    watchdog: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HeartbeatLook:
    """The state read. `listing` is None when there is no such PLC; `definitions` are the replies by M-variable.

    `pulses` were read in this order, after a renewal that was written if nothing was guarded.
    """

    permission: float
    i10: float
    activity: float
    lost: float
    ending: float
    definitions: Mapping[int, str]
    listing: tuple[str, ...] | None
    pulses: tuple[Pulse, Pulse]


def read_heartbeat(client: Controller, clock: Clock, machine: MachineProfile, dialect: Dialect) -> HeartbeatLook:
    """Read the heartbeat's state. Only the watchdog timer is written, and nothing while something is guarded.

    Raises DriverError: the link broke, or the controller refused a query.
    """
    names = (reserved.ACTIVITY, reserved.LOST, registers.ENDING)
    i5, i10, activity, lost, ending = client.numbers(
        f"I{PERMISSION}", f"I{SERVO_PERIOD}", *(f"P{number}" for number in names), again=True
    )
    found = _read_definitions(client, tuple(definitions(machine, dialect)))
    try:
        listing = client.question(f"LIST PLC{reserved.HEARTBEAT_PLC}", LIST_TIMEOUT_S)
    except ControllerError as refused:
        if refused.error_number != ErrorCode.DATA_ERROR:
            raise
        listing = None  # there is no such PLC
    if not activity:
        client.request(watchdog_line(dialect, i10))
    first = _pulse(client, clock, dialect)
    clock.wait(BETWEEN_PULSES_S)
    return HeartbeatLook(
        permission=i5,
        i10=i10,
        activity=activity,
        lost=lost,
        ending=ending,
        definitions=found,
        listing=listing,
        pulses=(first, _pulse(client, clock, dialect)),
    )


def _read_definitions(client: Controller, numbers: tuple[int, ...]) -> dict[int, str]:
    found: dict[int, str] = {}
    for start in range(0, len(numbers), ITEMS_PER_LINE):
        batch = numbers[start : start + ITEMS_PER_LINE]
        found.update(zip(batch, client.query(*(f"M{number}->" for number in batch), again=True), strict=True))
    return found


def _pulse(client: Controller, clock: Clock, dialect: Dialect) -> Pulse:
    asked_s = clock.now_s()
    echo, watchdog = client.numbers(f"P{reserved.ECHO}", watchdog_timer(dialect).name, again=True)
    return Pulse(asked_s=asked_s, answered_s=clock.now_s(), echo=echo, watchdog=watchdog)
