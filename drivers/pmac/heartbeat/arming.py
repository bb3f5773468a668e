"""Read a controller's heartbeat, with one renewal to see the timer count, and decide whether it is reliable."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from drivers.clock import Clock
from drivers.controller import Controller, query_in_lines
from drivers.errors import ControllerError
from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.plc import Policy, plc_lines
from drivers.pmac.heartbeat.watchdog import (
    ENDING,
    SERVO_PERIOD,
    GuardedActivity,
    definitions,
    watchdog_line,
    watchdog_timer,
)
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import without_end
from drivers.pmac.language.plc_statements import parse_plc_line
from drivers.pmac.language.syntax import PlcStatement
from drivers.pmac.language.text import format_number, format_plc_line
from drivers.pmac.memory import scan_pointer
from drivers.pmac.plcs.plc import I5_BACKGROUND
from drivers.pmac.settings import servo_cycle_ms
from profiles.machine import MachineProfile
from profiles.problem import Problem

RATE_TOLERANCE = 0.1
"""Permitted deviation of the watchdog timer's rate from I10, beyond the uncertainty of the request times."""

PLC = f"PLC {reserved.HEARTBEAT_PLC}"

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
    names = (reserved.ACTIVITY, reserved.LOST, ENDING)
    i5, i10, activity, lost, ending = client.numbers(
        f"I{PERMISSION}", f"I{SERVO_PERIOD}", *(f"P{number}" for number in names), again=True
    )
    numbers = tuple(definitions(machine, dialect))
    pointers = query_in_lines(client, [f"M{number}->" for number in numbers], ITEMS_PER_LINE)
    found = dict(zip(numbers, pointers, strict=True))
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


def _pulse(client: Controller, clock: Clock, dialect: Dialect) -> Pulse:
    asked_s = clock.now_s()
    echo, watchdog = client.numbers(f"P{reserved.ECHO}", watchdog_timer(dialect).name, again=True)
    return Pulse(asked_s=asked_s, answered_s=clock.now_s(), echo=echo, watchdog=watchdog)


def heartbeat_problems(
    look: HeartbeatLook, machine: MachineProfile, dialect: Dialect, policy: Policy
) -> tuple[Problem, ...]:
    """Return everything that forbids motion with this heartbeat; momentary states come last."""
    allowed = permits_plc(look.permission)
    before, after = look.pulses
    stands = look.listing is not None and not after.echo > before.echo
    return (
        *(() if allowed else (permission_problem(look.permission),)),
        *_text(look.listing, machine, dialect, policy),
        *_definitions(look, machine, dialect),
        # A PLC that is forbidden or missing is known to be silent.
        *((silent(before.echo, after.echo),) if allowed and stands else ()),
        *_timer(look, dialect),
        *_state(look),
    )


def permits_plc(permission: float) -> bool:
    """Whether this value of I5 lets the PLC run."""
    return bool(int(permission) & I5_BACKGROUND)


def permission_problem(permission: float) -> Problem:
    """Return the problem of a value of I5 that does not."""
    value, limit = format_number(permission), f"{I5_BACKGROUND}, {I5_BACKGROUND + 1}"
    return Problem(code="heartbeat.plcs_forbidden", key=f"I{PERMISSION}", value=value, limit=limit)


def silent(before: float, after: float) -> Problem:
    """Return the problem of a PLC that has stopped counting; it has counted to these numbers."""
    value, limit = format_number(after), f"> {format_number(before)}"
    return Problem(code="heartbeat.plc_silent", key=f"P{reserved.ECHO}", value=value, limit=limit)


def _text(
    listing: Sequence[str] | None, machine: MachineProfile, dialect: Dialect, policy: Policy
) -> Iterator[Problem]:
    """Compare statements, not characters: each controller has its own spelling in listings."""
    if listing is None:
        yield Problem(code="heartbeat.plc_missing", key=PLC)
        return
    target = statements_of(plc_lines(machine, dialect, policy))
    try:
        found = statements_of(without_end(listing))
    except PmacError as unreadable:
        yield Problem(code="heartbeat.plc_differs", key=PLC, value=unreadable.detail, limit=policy)
        return
    for place, (actual, expected) in enumerate(zip_longest(found, target), start=1):
        if actual != expected:
            value, limit = (format_plc_line((each,)) if each else "-" for each in (actual, expected))
            yield Problem(code="heartbeat.plc_differs", key=f"{PLC}:{place}", value=value, limit=limit)
            return


def statements_of(lines: Iterable[str]) -> list[PlcStatement]:
    """Return the statements of a text: each controller has its own spelling in listings."""
    return [statement for line in lines for statement in parse_plc_line(line)]


def _definitions(look: HeartbeatLook, machine: MachineProfile, dialect: Dialect) -> Iterator[Problem]:
    for number, target in definitions(machine, dialect).items():
        said = look.definitions.get(number, "").rpartition("->")[2].strip()
        scanner = Scanner(said)
        try:
            same = scan_pointer(scanner, dialect.highest_address) == target and scanner.at_end
        except PmacError:
            same = False
        if not same:
            limit = "*" if target is None else str(target)
            yield Problem(code="heartbeat.definition_differs", key=f"M{number}", value=said or "-", limit=limit)


def _timer(look: HeartbeatLook, dialect: Dialect) -> Iterator[Problem]:
    """Check that the timer counts down; skip it while something is guarded: it is being renewed."""
    if look.activity:
        return
    before, after = look.pulses
    counted, name = before.watchdog - after.watchdog, watchdog_timer(dialect).name
    if counted <= 0.0:
        value, limit = format_number(after.watchdog), f"< {format_number(before.watchdog)}"
        yield Problem(code="heartbeat.timer_stands", key=name, value=value, limit=limit)
        return
    cycle_s = servo_cycle_ms(look.i10) / 1000.0
    least = (1.0 - RATE_TOLERANCE) * (after.asked_s - before.answered_s) / cycle_s
    most = (1.0 + RATE_TOLERANCE) * (after.answered_s - before.asked_s) / cycle_s
    slow = counted < least and after.watchdog > 0.0  # at 0 it stops counting
    if slow or counted > most:
        value, limit = f"{format_number(counted)} cycles", f"{least:.0f}..{most:.0f} cycles"
        yield Problem(code="heartbeat.timer_rate", key=name, value=value, limit=limit)


def _state(look: HeartbeatLook) -> Iterator[Problem]:
    if look.ending:
        yield Problem(code="heartbeat.ending", key=PLC)
    if look.lost:
        yield lost_problem(look.lost)
    if look.activity:
        value = activity_name(look.activity)
        yield Problem(code="heartbeat.guarding", key=f"P{reserved.ACTIVITY}", value=value, limit="0")


def lost_problem(lost: float) -> Problem:
    """Return the problem that tells an operator what the controller has ended without its host."""
    return Problem(code="heartbeat.lost", key=f"P{reserved.LOST}", value=activity_name(lost), limit="0")


def activity_name(activity: float) -> str:
    """Return the word for what is or was guarded: a program cuts, or measures the tool."""
    names: dict[float, str] = {GuardedActivity.JOG: "jog", GuardedActivity.CUT: "program"}
    return names.get(activity) or format_number(activity)
