"""`console controller restore`: a whole backup is sent back to its controller, and read again."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from console.cli.backups.way_back import kept_before, read_whole, sending, sent_then_read, undo_command
from console.cli.library import refuse_unsigned
from console.cli.machine.card_access import Card, card_fields, card_line, with_control
from console.cli.machine.check_report import check_fields, check_lines
from console.cli.output import agreed, show
from console.session.data.controller_backups import load_backup
from console.text.catalogue import Catalogue
from drivers.commissioning.backup import Backup
from drivers.commissioning.check import Check
from drivers.commissioning.configuration import Configuration
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
from drivers.commissioning.verification import in_order
from profiles.files import printable


@dataclass(frozen=True, kw_only=True)
class _Restored:
    """What was done: `kept` is the backup of what there was before, None where nothing was sent."""

    before: tuple[Check, ...]
    kept: Path | None = None
    sent: int = 0
    left: tuple[Check, ...]
    limits: tuple[str, ...] = ()


def restore_backup(options: Namespace, card: Card, text: Catalogue) -> int:
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
    found = _Restored(before=before, left=before)
    if before:
        if not agreed(options, card.machine.name, card.simulated, text):
            return 1
        kept = kept_before(options, card, now)
        lines = restore_lines(content, backup, now)
        after = _sent_and_read(card, lines, programs, undo_command(options, kept), text)
        left = in_order(left_differing(backup.configuration, after, card.machine))
        limits = kept_limits(backup.configuration, after)
        found = _Restored(before=before, kept=kept, sent=len(lines), left=left, limits=limits)
    _show(options, card, backup, found, text)
    return 1 if found.left else 0


def _sent_and_read(
    card: Card, lines: tuple[str, ...], programs: Iterable[int], undo: str, text: Catalogue
) -> Configuration:
    """Send the lines, and return what the controller has after them."""

    def send() -> None:
        with sending(card, "configuration.sending", undo, text) as seen:
            with_control(card, lambda: restore(card.client, card.client.dialect, lines, seen))

    unread = text("configuration.restore_unread", command=undo)
    return sent_then_read(send, lambda: read_whole(card, text, "configuration.proving", programs), unread)


def _verdict(checks: tuple[Check, ...], backup: Backup, text: Catalogue) -> str:
    key = "configuration.differs_from" if checks else "configuration.no_difference"
    return text(key, count=len(checks), date=backup.date)


def _show(options: Namespace, card: Card, backup: Backup, found: _Restored, text: Catalogue) -> None:
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


def _lines(options: Namespace, backup: Backup, found: _Restored, text: Catalogue) -> list[str]:
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
        *_afterwards(undo_command(options, found.kept), text),
    ]


def _afterwards(undo: str, text: Catalogue) -> list[str]:
    return [text("configuration.restore_not_saved"), text("configuration.restore_undo", command=undo)]
