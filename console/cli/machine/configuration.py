"""Actions of `console controller` on a configuration: back up, verify, compare, apply; and all actions."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.backups.reading_progress import reading_shown
from console.cli.backups.restore_backup import restore_backup
from console.cli.library import data_of, refuse_unsigned
from console.cli.machine.card_access import Card, card_fields, card_line, with_control
from console.cli.machine.check_report import check_fields, check_lines, summary_line
from console.cli.machine.doctor_checks import signature_checks
from console.cli.output import show
from console.session.data.controller_backups import backup_path, compare_backup, write_backup
from console.session.data.kept_files import make_folder
from console.session.trial.explained import explained_checks
from console.text.catalogue import Catalogue
from drivers.commissioning.gains import Write, apply, gain_writes, refuse_unready
from drivers.commissioning.judged import Judged
from drivers.commissioning.verification import in_order, read_of_machine, verify
from profiles.files import printable
from profiles.findings import Severity, worst


def _backup(options: Namespace, card: Card, text: Catalogue) -> int:
    with reading_shown(card, text) as seen:
        found = write_backup(card.client, card.client.dialect, Path(options.file), values=True, seen_words=seen)
    counts = {name: len(getattr(found, name)) for name in ("settings", "axes", "plcs", "programs")}
    done = text("configuration.backup_done", **counts, count=counts["settings"], file=printable(options.file))
    show(
        options,
        lambda: {**card_fields(card), "file": options.file, **counts, "fingerprint": found.fingerprint},
        lambda: [card_line(card, text), done],
    )
    return 0


def _verify(options: Namespace, card: Card, text: Catalogue) -> int:
    verified = verify(card.client, card.machine, card.client.dialect)
    read = verified.judged.configuration
    trial = explained_checks(data_of(options), card.machine, card.address, read, simulated=card.simulated)
    checks = in_order([*verified.checks, *signature_checks(card), *trial])
    unmet = [check for check in checks if check.severity is not Severity.OK]
    show(
        options,
        lambda: {**card_fields(card), "checks": check_fields(checks, text)},
        lambda: [card_line(card, text), *check_lines(unmet, text), "", summary_line(checks, text)],
    )
    return 1 if worst(checks) is Severity.REFUSAL else 0


def _diff(options: Namespace, card: Card, text: Catalogue) -> int:
    with reading_shown(card, text, values=False):
        compared = compare_backup(card.client, card.client.dialect, card.machine, Path(options.file))
    checks = compared.checks
    verdict = text(
        "configuration.differs_from" if checks else "configuration.no_difference",
        count=len(checks),
        date=compared.date,
    )
    show(
        options,
        lambda: {**card_fields(card), "date": compared.date, "differences": check_fields(checks, text)},
        lambda: [card_line(card, text), verdict, *check_lines(checks, text)],
    )
    return 1 if checks else 0


def _apply(options: Namespace, card: Card, text: Catalogue) -> int:
    if options.yes and not card.simulated:
        refuse_unsigned(card.machine)
    client, machine = card.client, card.machine
    found = read_of_machine(client, machine, client.dialect)
    writes = gain_writes(Judged(configuration=found, machine=machine))
    backup = None
    if writes and options.yes:
        backup = backup_path(data_of(options), machine.name)
        refuse_unready(client, client.dialect)
        make_folder(backup.parent)
        write_backup(client, client.dialect, backup, private=True)
        with_control(card, lambda: apply(card.client, card.client.dialect, writes))
    show(
        options,
        lambda: {
            **card_fields(card),
            "lines": [{"line": write.line, "found": write.found} for write in writes],
            "applied": backup is not None,
            "backup": backup and str(backup),
        },
        lambda: [card_line(card, text), *_applied(writes, backup, text)],
    )
    return 0


def _applied(writes: tuple[Write, ...], backup: Path | None, text: Catalogue) -> list[str]:
    if not writes:
        return [text("configuration.nothing_to_apply")]
    lines = [f"  {text('configuration.line', line=write.line, found=write.found)}" for write in writes]
    if backup is None:
        return [text("configuration.dry_run"), *lines]
    first = text("configuration.backup_first", file=printable(str(backup)))
    return [first, *lines, text("configuration.applied", count=len(writes))]


WORKS = {"backup": _backup, "verify": _verify, "diff": _diff, "apply": _apply, "restore": restore_backup}
