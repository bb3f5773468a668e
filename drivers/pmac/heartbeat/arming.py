"""Decide whether a controller's heartbeat is reliable: refusals from the values read, nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.plc import Policy, plc_lines
from drivers.pmac.heartbeat.reading import PERMISSION, HeartbeatLook
from drivers.pmac.heartbeat.registers import definitions
from drivers.pmac.heartbeat.watchdog import Activity, watchdog_timer
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.plc_statements import parse_plc_line
from drivers.pmac.language.syntax import PlcStatement
from drivers.pmac.language.text import format_number, format_plc_line
from drivers.pmac.memory import Pointer, scan_pointer
from drivers.pmac.plcs.plc import I5_BACKGROUND
from drivers.pmac.settings import servo_cycle_ms
from profiles.machine import MachineProfile
from profiles.problem import Problem

RATE_TOLERANCE = 0.1
"""Permitted deviation of the watchdog timer's rate from I10, beyond the uncertainty of the request times."""

PLC = f"PLC {reserved.HEARTBEAT_PLC}"


def heartbeat_problems(
    look: HeartbeatLook, machine: MachineProfile, dialect: Dialect, policy: Policy
) -> tuple[Problem, ...]:
    """Return everything that forbids motion with this heartbeat; momentary states come last."""
    return (
        *_permission(look),
        *_text(look, machine, dialect, policy),
        *_definitions(look, machine, dialect),
        *_echo(look),
        *_lease(look, dialect),
        *_state(look),
    )


def _permission(look: HeartbeatLook) -> Iterator[Problem]:
    if not permitted(look.permission):
        yield forbidden(look.permission)


def permitted(permission: float) -> bool:
    """Whether this value of I5 lets the PLC run."""
    return bool(int(permission) & I5_BACKGROUND)


def forbidden(permission: float) -> Problem:
    """Return the problem of a value of I5 that does not."""
    return Problem(
        code="heartbeat.plcs_forbidden",
        key=f"I{PERMISSION}",
        value=format_number(permission),
        limit=f"{I5_BACKGROUND}, {I5_BACKGROUND + 1}",
    )


def silent(before: float, after: float) -> Problem:
    """Return the problem of a PLC that has stopped counting; it has counted to these numbers."""
    return Problem(
        code="heartbeat.plc_silent",
        key=f"P{reserved.ECHO}",
        value=format_number(after),
        limit=f"> {format_number(before)}",
    )


def _text(look: HeartbeatLook, machine: MachineProfile, dialect: Dialect, policy: Policy) -> Iterator[Problem]:
    """Compare statements, not characters: each controller has its own spelling in listings."""
    if look.listing is None:
        yield Problem(code="heartbeat.plc_missing", key=PLC)
        return
    target = list(_statements(plc_lines(machine, dialect, policy)))
    try:
        found = list(_statements(look.listing))
    except PmacError as unreadable:
        yield Problem(code="heartbeat.plc_differs", key=PLC, value=unreadable.detail, limit=policy)
        return
    if found == target:
        return
    longest = max(len(found), len(target))
    place = next(n for n in range(longest) if found[n : n + 1] != target[n : n + 1])
    yield Problem(
        code="heartbeat.plc_differs",
        key=f"{PLC}:{place + 1}",
        value=_written(found[place : place + 1]),
        limit=_written(target[place : place + 1]),
    )


def _statements(lines: Iterable[str]) -> Iterator[PlcStatement]:
    for line in lines:
        yield from parse_plc_line(line)


def _written(statements: Sequence[PlcStatement]) -> str:
    return format_plc_line(tuple(statements)) or "-"


def _definitions(look: HeartbeatLook, machine: MachineProfile, dialect: Dialect) -> Iterator[Problem]:
    for number, target in definitions(machine, dialect).items():
        said = look.definitions.get(number, "").rpartition("->")[2].strip()
        if not _points_at(said, target, dialect):
            yield Problem(
                code="heartbeat.definition_differs",
                key=f"M{number}",
                value=said or "-",
                limit="*" if target is None else str(target),
            )


def _points_at(said: str, target: Pointer | None, dialect: Dialect) -> bool:
    scanner = Scanner(said)
    try:
        return scan_pointer(scanner, dialect.highest_address) == target and scanner.at_end
    except PmacError:
        return False


def _echo(look: HeartbeatLook) -> Iterator[Problem]:
    """Skip a PLC that is forbidden or missing: it is known to be silent."""
    before, after = look.pulses
    if permitted(look.permission) and look.listing is not None and not after.echo > before.echo:
        yield silent(before.echo, after.echo)


def _lease(look: HeartbeatLook, dialect: Dialect) -> Iterator[Problem]:
    """Skip the timer while something is guarded: it is being renewed."""
    if look.activity:
        return
    before, after = look.pulses
    counted, name = before.watchdog - after.watchdog, watchdog_timer(dialect).name
    if counted <= 0.0:
        yield Problem(
            code="heartbeat.lease_stands",
            key=name,
            value=format_number(after.watchdog),
            limit=f"< {format_number(before.watchdog)}",
        )
        return
    cycle_s = servo_cycle_ms(look.i10) / 1000.0
    least = (1.0 - RATE_TOLERANCE) * (after.asked_s - before.answered_s) / cycle_s
    most = (1.0 + RATE_TOLERANCE) * (after.answered_s - before.asked_s) / cycle_s
    slow = counted < least and after.watchdog > 0.0  # at 0 it stops counting
    if slow or counted > most:
        yield Problem(
            code="heartbeat.lease_rate",
            key=name,
            value=f"{format_number(counted)} cycles",
            limit=f"{least:.0f}..{most:.0f} cycles",
        )


def _state(look: HeartbeatLook) -> Iterator[Problem]:
    if look.ending:
        yield Problem(code="heartbeat.ending", key=PLC)
    if look.lost:
        yield lost_problem(look.lost)
    if look.activity:
        yield Problem(
            code="heartbeat.guarding", key=f"P{reserved.ACTIVITY}", value=_said(look.activity), limit="0"
        )


def lost_problem(lost: float) -> Problem:
    """Return the problem that tells an operator what the controller has ended without its host."""
    return Problem(code="heartbeat.lost", key=f"P{reserved.LOST}", value=_said(lost), limit="0")


def _said(activity: float) -> str:
    names = {Activity.JOG: "jog", Activity.CUT: "cut"}
    known = next((name for number, name in names.items() if number == activity), None)
    return format_number(activity) if known is None else known
