"""Actions of `console controller` on a configuration: back up, verify, compare, apply; and all actions."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from console.cli.backups.way_back import (
    kept_before,
    read_whole,
    reading_shown,
    sending,
    sent_then_read,
    undo_command,
)
from console.cli.library import data_of, refuse_unsigned
from console.cli.machine.card_access import ConnectedController, card_fields, card_line, with_control
from console.cli.machine.doctor_checks import signature_checks
from console.cli.output import confirm_motion, show
from console.session.data.controller_backups import backup_path, compare_backup, load_backup, write_backup
from console.session.data.kept_files import make_folder
from console.session.tuning.trial_checks import explained_checks
from console.text.catalogue import Catalogue
from console.text.checks import check_fields, check_lines, summary_line
from drivers.commissioning.backup import Backup
from drivers.commissioning.check import Check
from drivers.commissioning.checked_configuration import CheckedConfiguration
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.gains import Write, apply, gain_writes, refuse_unready
from drivers.commissioning.restoring import (
    kept_limits,
    left_differing,
    refuse_busy,
    refuse_hidden,
    refuse_other_controller,
    refuse_other_memory,
    restore,
    restore_lines,
)
from drivers.commissioning.verification import in_order, read_of_machine, verify
from profiles.files import printable
from profiles.findings import Severity, worst


def _backup(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
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


def _verify(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
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


def _diff(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
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


def _apply(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
    if options.yes and not card.simulated:
        refuse_unsigned(card.machine)
    client, machine = card.client, card.machine
    found = read_of_machine(client, machine, client.dialect)
    writes = gain_writes(CheckedConfiguration(configuration=found, machine=machine))
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
        lambda: [card_line(card, text), *_describe_applied_writes(writes, backup, text)],
    )
    return 0


def _describe_applied_writes(writes: tuple[Write, ...], backup: Path | None, text: Catalogue) -> list[str]:
    if not writes:
        return [text("configuration.nothing_to_apply")]
    lines = [f"  {text('configuration.line', line=write.line, found=write.found)}" for write in writes]
    if backup is None:
        return [text("configuration.dry_run"), *lines]
    first = text("configuration.backup_first", file=printable(str(backup)))
    return [first, *lines, text("configuration.applied", count=len(writes))]


@dataclass(frozen=True, kw_only=True)
class _RestoreResult:
    """What was done: `kept` is the backup of what there was before, None if nothing was sent."""

    before: tuple[Check, ...]
    kept: Path | None = None
    sent: int = 0
    left: tuple[Check, ...]
    limits: tuple[str, ...] = ()


def restore_backup(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
    """Compare, ask, back up what there is, send, read everything again; 1 where anything differs after that."""
    if not card.simulated:
        refuse_unsigned(card.machine)
    client, dialect, path = card.client, card.client.dialect, Path(options.file)
    content, backup = load_backup(path)
    refuse_other_controller(backup, card.kind, dialect, printable(str(path)))
    refuse_busy(client, dialect)
    programs = backup.configuration.sought_programs
    now = read_whole(card, text, "configuration.reading", programs)
    refuse_hidden(now, client.link.address)
    refuse_other_memory(backup, now, client.link.address)
    before = in_order(left_differing(backup.configuration, now, card.machine))
    if not options.json:
        print("\n".join([card_line(card, text), _verdict(before, backup, text), *check_lines(before, text)]))
    found = _RestoreResult(before=before, left=before)
    if before:
        if not confirm_motion(options, card.machine.name, card.simulated, text):
            return 1
        kept = kept_before(options, card, now)
        lines = restore_lines(content, backup, now)
        after = _sent_and_read(card, lines, programs, undo_command(options, kept), text)
        left = in_order(left_differing(backup.configuration, after, card.machine))
        limits = kept_limits(backup.configuration, after)
        found = _RestoreResult(before=before, kept=kept, sent=len(lines), left=left, limits=limits)
    _show(options, card, backup, found, text)
    return 1 if found.left else 0


def _sent_and_read(
    card: ConnectedController, lines: tuple[str, ...], programs: Iterable[int], undo: str, text: Catalogue
) -> ControllerConfiguration:
    """Send the lines, and return what the controller has after them."""

    def send() -> None:
        with sending(card, "configuration.sending", undo, text) as seen:
            with_control(card, lambda: restore(card.client, card.client.dialect, lines, seen))

    unread = text("configuration.restore_unread", command=undo)
    return sent_then_read(send, lambda: read_whole(card, text, "configuration.proving", programs), unread)


def _verdict(checks: tuple[Check, ...], backup: Backup, text: Catalogue) -> str:
    key = "configuration.differs_from" if checks else "configuration.no_difference"
    return text(key, count=len(checks), date=backup.date)


def _show(
    options: Namespace, card: ConnectedController, backup: Backup, found: _RestoreResult, text: Catalogue
) -> None:
    show(
        options,
        lambda: {
            **card_fields(card),
            "date": backup.date,
            "found": check_fields(found.before, text),
            "backup": found.kept and str(found.kept),
            "sent": found.sent,
            "differences": check_fields(found.left, text),
        },
        lambda: _lines(options, backup, found, text),
    )


def _lines(options: Namespace, backup: Backup, found: _RestoreResult, text: Catalogue) -> list[str]:
    hidden = backup.configuration.locked
    lines = [text("configuration.restore_hidden", names=", ".join(hidden))] if hidden else []
    if found.kept is None:
        return [*lines, text("configuration.nothing_to_restore")]
    done = text("configuration.restored", count=found.sent)
    if found.left:
        done = text("configuration.restored_not_all", count=found.sent)
    if found.limits:
        lines.append(text("configuration.limits_kept", names=", ".join(found.limits)))
    return [
        "",
        *lines,
        done,
        *check_lines(found.left, text),
        "",
        text("configuration.restore_not_saved"),
        text("configuration.restore_undo", command=undo_command(options, found.kept)),
    ]


WORKS = {"backup": _backup, "verify": _verify, "diff": _diff, "apply": _apply, "restore": restore_backup}
