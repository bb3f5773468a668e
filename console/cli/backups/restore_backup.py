"""`console controller restore`: a whole backup is sent back to its controller, and read again."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

from console.cli.backups.reading_progress import reading_shown, shown
from console.cli.library import data_of, refuse_unsigned
from console.cli.machine.card_access import Card, card_fields, card_line, with_control
from console.cli.machine.check_report import check_fields, check_lines
from console.cli.output import agreed, show
from console.session.data.controller_backups import backup_path, keep_backup, load_backup
from console.session.errors import Interrupted
from console.session.time_left import fraction_done
from console.text.catalogue import Catalogue
from drivers.commissioning.backup import Backup
from drivers.commissioning.check import Check
from drivers.commissioning.configuration import Configuration
from drivers.commissioning.reading import read_configuration, whole_card
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
from drivers.errors import DriverError
from profiles.files import printable
from profiles.problem import Problem


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
    now = _read(card, text, "configuration.reading")
    refuse_hidden(now, client.link.address)
    refuse_other_memory(backup, now, client.link.address)
    before = in_order(left_differing(backup.configuration, now, card.machine))
    if not options.json:
        print("\n".join([card_line(card, text), _verdict(before, backup, text), *check_lines(before, text)]))
    found = _Restored(before=before, left=before)
    if before:
        if not agreed(options, card.machine.name, card.simulated, text):
            return 1
        kept = backup_path(data_of(options), card.machine.name)
        keep_backup(now, kept, private=True)
        lines = restore_lines(content, backup, now)
        after = _sent_and_read(card, lines, _undo(options, kept), text)
        left = in_order(left_differing(backup.configuration, after, card.machine))
        limits = kept_limits(backup.configuration, after)
        found = _Restored(before=before, kept=kept, sent=len(lines), left=left, limits=limits)
    _show(options, card, backup, found, text)
    return 1 if found.left else 0


def _sent_and_read(card: Card, lines: tuple[str, ...], undo: str, text: Catalogue) -> Configuration:
    """Send the lines, and return what the controller has after them."""
    try:
        _send(card, lines, undo, text)
        return _read(card, text, "configuration.proving")
    except Interrupted:  # once all is sent: a half of a backup is worse than a late Ctrl-C
        print(text("configuration.restore_unread", command=undo), file=sys.stderr)
        raise


def _read(card: Card, text: Catalogue, key: str) -> Configuration:
    """Read the whole controller with all values: what there is before is also the way back."""
    dialect = card.client.dialect
    with reading_shown(card, text, key=key) as seen:
        return read_configuration(card.client, dialect, whole_card(dialect, values=True), seen)


def _undo(options: Namespace, kept: Path) -> str:
    """Return the command that restores what there was before, at the same controller."""
    words = ["console", "controller", "restore", printable(str(kept))]
    for name, value in (("--machine", options.machine), ("--link", options.link)):
        words += [name, str(value)] if value else []
    return shlex.join(words)


def _send(card: Card, lines: tuple[str, ...], undo: str, text: Catalogue) -> None:
    """Send the lines as the owner of the machine. A failure names the backup of what there was before."""
    sent = 0

    def seen(number: int) -> None:
        nonlocal sent
        sent = number

    def work() -> None:
        restore(card.client, card.client.dialect, lines, seen)

    try:
        with shown("configuration.sending", text, lambda: fraction_done(sent, len(lines))):
            with_control(card, work)
    except DriverError as error:
        if any(problem.code == "controller.restored_in_part" for problem in error.problems):
            back = Problem(code="controller.restore_undo", where=card.address, value=undo)
            raise DriverError(*error.problems, back) from error
        raise


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
    return ["", *lines, done, *check_lines(found.left, text), "", *_afterwards(_undo(options, found.kept), text)]


def _afterwards(undo: str, text: Catalogue) -> list[str]:
    return [text("configuration.restore_not_saved"), text("configuration.restore_undo", command=undo)]
