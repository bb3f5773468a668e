"""Checks of `console doctor` besides those of the configuration: signature, link, stops, data, and by moving."""

from __future__ import annotations

import os
import sqlite3
import stat
from datetime import date, timedelta
from importlib.metadata import entry_points, version
from pathlib import Path
from platform import python_version

from console.cli.machine.card_access import ConnectedController, owned_lathe
from console.cli.machine.stopping import StopMonitor
from console.session.data.folder_state import LITTLE_BYTES, FolderState, state_of
from console.session.data.stop_records import load, store, withdraw
from console.session.signals import Interruption
from console.session.station.machine_connection import guard
from console.text.catalogue import Catalogue
from drivers.commissioning.check import Check, Group
from drivers.commissioning.proofs.bench import list_missing_tests, names_of
from drivers.commissioning.proofs.proving import prove
from drivers.commissioning.proofs.stopping import MeasuredStops
from drivers.commissioning.stop_record import VALID_DAYS, StopRecord, StopsNow, record_problems, stop_key
from drivers.commissioning.verification import Verification
from drivers.lathe.ownership import Ownership
from drivers.link.base import StopWay
from drivers.pmac.framing import LineCheck
from profiles.files import printable
from profiles.findings import Severity
from profiles.machine import MACHINE, real_machine_problems
from profiles.problem import Problem, ProfileError

STOPS = ("proof_heartbeat", "proof_stop_")
"""Codes of the commissioning tests that a record rests on."""

PROOF = "proof_"
"""What the code of a commissioning test that was made begins with."""

DISTRIBUTION = "trilobe"
"""Name of this distribution, and of the command that no other one claims."""


WAL_FROM, WAL_RESET_FIXED = (3, 7, 0), ((3, 51, 3), (3, 50, 7), (3, 44, 6))
"""Versions of SQLite: with a write-ahead log, and without the race in it; the later ones are of older branches."""


def signature_checks(card: ConnectedController) -> list[Check]:
    """Return a failure where the profile of a simulated lathe meets a real link; otherwise nothing."""
    return [
        Check(
            group=Group.SAFETY,
            code=problem.code.partition(".")[2],
            severity=Severity.REFUSAL,
            found=problem.value,
            wanted=MACHINE,
        )
        for problem in (() if card.simulated else real_machine_problems(card.machine))
    ]


def arrival_check(line_check: LineCheck) -> Check:
    """Return the check of what ensures that a motion command arrives as it was sent."""
    code = "network_checksums" if line_check is LineCheck.NETWORK else "line_checksums"
    severity = Severity.WARNING if line_check is LineCheck.NOBODY else Severity.OK
    return Check(group=Group.CARD, code=code, severity=severity)


def command_checks() -> list[Check]:
    """Return a warning for each other distribution whose `console` may shadow ours."""
    claims = entry_points(group="console_scripts", name="console")
    others = sorted({claim.dist.name for claim in claims if claim.dist} - {DISTRIBUTION})
    return [
        Check(
            group=Group.COMPUTER, code="command_taken", severity=Severity.WARNING, found=other, wanted=DISTRIBUTION
        )
        for other in others
    ]


def library_checks() -> list[Check]:
    """Return the versions of what the records and the numbers rest on, and a known fault of this SQLite."""
    libraries = (f"{name} {version(name)}" for name in ("numpy", "textual", "pyserial"))
    sqlite = sqlite3.sqlite_version
    names = ", ".join((f"Python {python_version()}", f"SQLite {sqlite}", *libraries))
    checks = [Check(Group.COMPUTER, "libraries", Severity.OK, found=names)]
    if loses_wal_reset(sqlite3.sqlite_version_info):
        fixed = " | ".join(".".join(map(str, each)) for each in WAL_RESET_FIXED)
        checks.append(Check(Group.COMPUTER, "wal_reset", Severity.NOTICE, found=sqlite, wanted=fixed))
    return checks


def loses_wal_reset(found: tuple[int, ...]) -> bool:
    """Whether a SQLite has its WAL-reset bug: a commit beside a checkpoint may damage the file."""
    fixed = next((each for each in WAL_RESET_FIXED if each[:2] == found[:2]), WAL_RESET_FIXED[0])
    return WAL_FROM <= found < fixed


def proven_checks(card: ConnectedController, verification: Verification, text: Catalogue) -> tuple[Check, ...]:
    """Run the commissioning tests with control of the machine; every ending signal becomes a stop."""
    interruption, ownership = Interruption(), Ownership(card.client)
    lathe, owning = owned_lathe(card, ownership)
    guard(interruption, lathe, None)
    interruption.install()
    # Stops are measured here, so nothing may repeat them; only the end of the process is enforced.
    with StopMonitor(interruption, text).watching(card.stop, ends_only=True):
        try:
            owning.claim()
            proven = prove(card.client, card.stop, card.clock, verification, ownership.number, ownership.see)
        finally:
            owning.release()
    keep_stops(card, proven, date.today())
    return proven.checks


def stop_checks(card: ConnectedController, today: date) -> list[Check]:
    """Check that the stopping-performance record allows arming; a simulated machine measures its own then."""
    if card.simulated:
        return []
    checks, stop_way = _record_checks(card, today), card.stop.way
    if stop_way is not StopWay.DIRECT:  # a connection for stops was requested
        severity = Severity.OK if stop_way is StopWay.RESERVED else Severity.REFUSAL
        checks.insert(0, Check(group=Group.STOPS, code="stop_connection", severity=severity))
    return checks


def kept_proofs(card: ConnectedController, stops: list[Check]) -> list[Check]:
    """Return what is known of the commissioning tests without moving: those that passed with the valid record."""
    record = load(card.data, card.machine) if any(check.code == "stop_record" for check in stops) else None
    names = names_of(card.machine)
    if record is None or not record.tests:
        return list_missing_tests(names)
    facts = {"count": str(len(record.tests)), "address": record.address}
    found = record.measured_at.isoformat()
    kept = Check(group=Group.PROOFS, code="proofs_kept", severity=Severity.OK, found=found, facts=facts)
    return [kept, *list_missing_tests(name for name in names if name not in record.tests)]


def _record_checks(card: ConnectedController, today: date) -> list[Check]:
    try:
        record = load(card.data, card.machine)
    except ProfileError as error:
        return [_warning_check(problem) for problem in error.problems]
    problems = record_problems(record, _present_stops(card, today))
    if record is None or problems:
        return [_warning_check(problem) for problem in problems]
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


def keep_stops(card: ConnectedController, proven: MeasuredStops, today: date) -> None:
    """Store the measured stopping performance; a stop out of specification removes the record."""
    if card.simulated:
        return
    failed = any(check.severity is Severity.REFUSAL and check.code.startswith(STOPS) for check in proven.checks)
    if failed or card.stop.way is StopWay.LOST:
        withdraw(card.data, card.machine)
        return
    now = _present_stops(card, today)
    record = StopRecord(
        machine=card.machine.name,
        kind=card.kind,
        version=card.version,
        key=now.key,
        measured_at=today,
        address=card.address,
        stop_way=card.stop.way,
        entries=proven.entries,
        tests=tuple(
            check.code.removeprefix(PROOF)
            for check in proven.checks
            if check.code.startswith(PROOF) and check.severity is Severity.OK
        ),
    )
    if not record_problems(record, now):
        store(card.data, card.machine, record)


def _present_stops(card: ConnectedController, today: date) -> StopsNow:
    key = stop_key(card.client, card.machine, card.client.dialect)
    return StopsNow(machine=card.machine, key=key, today=today, stop_way=card.stop.way, address=card.address)


def _warning_check(problem: Problem) -> Check:
    """Return a warning: such a machine may be moved, or its stops could not be tested; it cannot be armed."""
    area, _, name = problem.code.partition(".")
    return Check(
        group=Group.STOPS,
        code=f"stops_{name}" if area == "stops" else "stops_unreadable",
        severity=Severity.WARNING,
        found=problem.value,
        wanted=problem.limit,
        facts={"machine": problem.key},
    )


def data_folder_checks(data: Path) -> list[Check]:
    """Return one check of the data folder where it is in order, else one for each thing that is not."""
    where = printable(str(data.absolute()))
    try:
        state = state_of(data)
    except OSError as error:
        return [_check("data_folder_unusable", Severity.REFUSAL, where, found=error.strerror or str(error))]
    if state is None:
        above = next(each for each in data.absolute().parents if each.exists())
        if not os.access(above, os.W_OK | os.X_OK):
            return [_check("data_folder_unmakeable", Severity.REFUSAL, where, found=printable(str(above)))]
        return [_check("data_folder_missing", Severity.NOTICE, where)]
    if not state.usable:
        return [_check("data_folder_unusable", Severity.REFUSAL, where, found=state.rights)]
    return _check_folder_state(state, where) or [
        _check(
            "data_folder_shared" if state.shared else "data_folder_private",
            Severity.OK,
            where,
            found=state.rights,
            wanted=state.group,
            free=state.free_space,
        )
    ]


def _check_folder_state(state: FolderState, where: str) -> list[Check]:
    found, mode, checks = state.rights, state.mode, []
    if mode & stat.S_IWOTH:
        checks.append(_check("data_folder_open", Severity.REFUSAL, where, found=found))
    elif mode & stat.S_ISGID and not mode & stat.S_IWGRP and mode & stat.S_IXGRP:
        checks.append(_check("data_folder_half", Severity.WARNING, where, found=found, wanted=state.group))
    elif mode & stat.S_IWGRP and not mode & stat.S_ISGID:
        checks.append(_check("data_folder_not_setgid", Severity.WARNING, where, found=found, wanted=state.group))
    elif state.shared and mode & stat.S_ISVTX:
        checks.append(_check("data_folder_sticky", Severity.WARNING, where, found=found))
    if state.closed:
        code = "data_folder_closed" if state.shared else "data_folder_foreign"
        first = printable(str(state.closed[0].relative_to(state.path)))
        count = str(len(state.closed))
        checks.append(_check(code, Severity.WARNING, where, found=first, wanted=state.group, number=count))
    if state.free_bytes < LITTLE_BYTES:
        checks.append(_check("data_folder_full", Severity.WARNING, where, found=state.free_space))
    return checks


def _check(code: str, severity: Severity, where: str, *, found: str = "", wanted: str = "", **facts: str) -> Check:
    facts = {"where": where, **facts}
    return Check(group=Group.COMPUTER, code=code, severity=severity, found=found, wanted=wanted, facts=facts)
