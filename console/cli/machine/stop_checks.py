"""Stopping-performance record of a machine, as `console doctor` judges and keeps it."""

from __future__ import annotations

from argparse import Namespace
from datetime import date, timedelta
from typing import TYPE_CHECKING

from console.cli.library import data_of
from console.cli.machine.card_access import Card
from console.session.data.stop_records import load, store, withdraw
from drivers.commissioning.check import Check, Group
from drivers.commissioning.stop_record import StopRecord, stop_key
from drivers.commissioning.stop_record_check import VALID_DAYS, StopsNow, record_problems
from drivers.link.base import StopWay
from profiles.findings import Severity
from profiles.problem import Problem, ProfileError

if TYPE_CHECKING:
    from drivers.commissioning.proofs.proving import Proven

STOPS = ("proof_lease", "proof_stop_")
"""Codes of the commissioning tests that a record rests on."""


def stop_checks(options: Namespace, card: Card, today: date) -> list[Check]:
    """Check that the stopping-performance record allows arming; a simulated machine measures its own then."""
    return [] if card.simulated else [*_connection_checks(card.stop.way), *_record_checks(options, card, today)]


def _connection_checks(stop_way: StopWay) -> list[Check]:
    """Check that stops have the requested connection; nothing where none was requested."""
    if stop_way is StopWay.DIRECT:
        return []
    severity = Severity.OK if stop_way is StopWay.RESERVED else Severity.REFUSAL
    return [Check(group=Group.STOPS, code="stop_connection", severity=severity)]


def _record_checks(options: Namespace, card: Card, today: date) -> list[Check]:
    try:
        record = load(data_of(options), card.machine)
    except ProfileError as error:
        return [_warned(problem) for problem in error.problems]
    problems = record_problems(record, _now(card, today))
    if record is None or problems:
        return [_warned(problem) for problem in problems]
    until = record.measured_at + timedelta(days=VALID_DAYS)
    return [
        Check(
            group=Group.STOPS,
            code="stop_record",
            severity=Severity.OK,
            found=record.measured_at.isoformat(),
            wanted=until.isoformat(),
            facts={"address": record.address},
        )
    ]


def keep_stops(options: Namespace, card: Card, proven: Proven, today: date) -> None:
    """Store the measured stopping performance; a stop out of specification removes the record.

    Raises:
        ProfileError: `file.not_writable`.
        DriverError: the link broke.
    """
    if card.simulated:
        return
    failed = any(check.severity is Severity.REFUSAL and check.code.startswith(STOPS) for check in proven.checks)
    if failed or card.stop.way is StopWay.LOST:
        withdraw(data_of(options), card.machine)
        return
    now = _now(card, today)
    record = StopRecord(
        machine=card.machine.name,
        kind=card.kind,
        version=card.version,
        key=now.key,
        measured_at=today,
        address=card.address,
        stop_way=card.stop.way,
        entries=proven.stops,
    )
    if not record_problems(record, now):
        store(data_of(options), card.machine, record)


def _now(card: Card, today: date) -> StopsNow:
    """Return what a valid record must match.

    Raises:
        DriverError: the link broke.
    """
    key = stop_key(card.client, card.machine, card.dialect)
    return StopsNow(machine=card.machine, key=key, today=today, stop_way=card.stop.way, address=card.address)


def _warned(problem: Problem) -> Check:
    """Return a warning: such a machine may be moved, or its stops could not be tested; it cannot be armed."""
    area, _, name = problem.code.partition(".")
    code = f"stops_{name}" if area == "stops" else "stops_unreadable"
    return Check(
        group=Group.STOPS,
        code=code,
        severity=Severity.WARNING,
        found=problem.value,
        wanted=problem.limit,
        facts={"machine": problem.key},
    )
