"""`console doctor`: may this machine be moved? Every check with a tick or a cross, and what helps."""

from __future__ import annotations

from argparse import Namespace
from contextlib import suppress
from datetime import date, timedelta
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from console.cli.card_access import Card, opened_card
from console.cli.check_lines import check_fields, check_lines, signature_checks, summary
from console.cli.controller import head, identity
from console.cli.library import agreed, data_of
from console.cli.output import print_json
from console.cli.stopping import Stopping
from console.session.data.stop_records import load, store, withdraw
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.commissioning.check import Check, Group
from drivers.commissioning.proofs.bench import names_of, unproven
from drivers.commissioning.stop_record import StopRecord, stop_key
from drivers.commissioning.stop_record_check import VALID_DAYS, StopsNow, record_problems
from drivers.commissioning.verification import Verification, in_order, verify
from drivers.errors import DriverError
from drivers.lathe.ownership import Ownership
from drivers.lathe.standing import Standing
from drivers.link.base import StopWay
from drivers.pmac.checksums import LineCheck
from profiles.findings import Severity, worst
from profiles.problem import Problem, ProfileError

if TYPE_CHECKING:
    from drivers.commissioning.proofs.proving import Proven


DISTRIBUTION = "trilobe"
"""The name of this one, and of the command that no other claims."""

STOPS = ("proof_lease", "proof_stop_")
"""The codes of the proofs that a record rests on."""


def stop_checks(options: Namespace, card: Card, today: date) -> list[Check]:
    """Return whether the machine may be armed by its stop record; a simulated one measures its own when it is."""
    return [] if card.simulated else [*_connection_checks(card.stop.way), *_record_checks(options, card, today)]


def _connection_checks(stop_way: StopWay) -> list[Check]:
    """Return whether stops have the connection that was asked for; nothing where none was."""
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
    """Write down how the machine was seen to stop; a stop that was not as it should be takes the record away.

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
    """Return what a record has to be of to be believed.

    Raises:
        DriverError: the link broke.
    """
    key = stop_key(card.client, card.machine, card.dialect)
    return StopsNow(machine=card.machine, key=key, today=today, stop_way=card.stop.way, address=card.address)


def _warned(problem: Problem) -> Check:
    """Such a machine may be moved, or nobody could prove its stops; it is only not armed."""
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


def main(options: Namespace, text: Catalogue) -> int:
    """Check, and prove if that is asked for; 1 when something fails."""
    with opened_card(options, text) as card:
        unsigned = signature_checks(card)
        verification = verify(card.client, card.machine, card.dialect)
        asked = options.prove and not unsigned
        moves = asked and agreed(options, card.machine.name, card.simulated, text, "doctor")
        if moves and not card.simulated:
            verification = verify(card.client, card.machine, card.dialect)  # the answer may have taken its time
        proofs = _proven(options, card, verification, text) if moves else unproven(names_of(card.machine))
        stops = stop_checks(options, card, date.today())
    checks = in_order(
        [
            *verification.checks,
            _arrival_check(card.client.line_check),
            *unsigned,
            *stops,
            *proofs,
            *_command_checks(),
        ]
    )
    if options.json:
        print_json({**identity(card), "checks": check_fields(checks, text)})
    else:
        lines = [head(card, text), text("card.marks"), *check_lines(checks, text), "", summary(checks, text)]
        print("\n".join(lines))
    refused = options.prove and not moves
    return 1 if refused or worst(checks) is Severity.REFUSAL else 0


def _command_checks() -> list[Check]:
    """Return a warning for each other distribution whose `console` may stand in the place of ours."""
    claims = entry_points(group="console_scripts", name="console")
    others = sorted({claim.dist.name for claim in claims if claim.dist} - {DISTRIBUTION})
    return [
        Check(
            group=Group.SYSTEM, code="command_taken", severity=Severity.WARNING, found=other, wanted=DISTRIBUTION
        )
        for other in others
    ]


def _arrival_check(line_check: LineCheck) -> Check:
    """Return who sees that a line that moves something arrives as it was sent."""
    code = "network_checksums" if line_check is LineCheck.NETWORK else "line_checksums"
    severity = Severity.WARNING if line_check is LineCheck.NOBODY else Severity.OK
    return Check(group=Group.CARD, code=code, severity=severity)


def _proven(options: Namespace, card: Card, verification: Verification, text: Catalogue) -> tuple[Check, ...]:
    """Prove as the one who controls the machine, with every signal that would end the command as a stop."""
    # What gathers loads numerics; nobody waits for them who proves nothing.
    from drivers.commissioning.proofs.proving import prove

    interruption = Interruption()
    ownership = Ownership(card.client)
    interruption.guard(
        card.stop,
        anothers=lambda: ownership.standing is not Standing.OWNER,
        changing=lambda: ownership.standing is Standing.CHANGING,
    )
    interruption.install()
    # Stops are measured here, so that nobody may repeat them; only the end of the process is seen to.
    with Stopping(interruption, text).watching(card.stop, ends_only=True):
        try:
            ownership.claim()
            proven = prove(card.client, card.stop, card.clock, verification, ownership.number, ownership.see)
        finally:
            with suppress(DriverError):
                ownership.release()
    keep_stops(options, card, proven, date.today())
    return proven.checks
