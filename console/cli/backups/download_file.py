"""`console controller download`: the programs of a file are sent to the controller, and read again."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

from console.cli.backups.downloaded_source import Source, read_source
from console.cli.backups.way_back import kept_before, read_whole, sending, sent_then_read, undo_command
from console.cli.library import profile_of, refuse_unsigned
from console.cli.machine import card_access
from console.cli.machine.card_access import Card, card_fields, card_line, with_control
from console.cli.machine.check_report import check_fields, check_lines
from console.cli.output import agreed, show
from console.cli.part.check_program_report import finding_fields, finding_lines
from console.text.catalogue import Catalogue
from console.text.columns import broken
from drivers.commissioning.check import Check
from drivers.commissioning.downloading import (
    Change,
    differing,
    may_run,
    planned,
    send,
    sent_lines,
)
from drivers.errors import RefusedError
from profiles.files import printable
from profiles.problem import Problem

WIDTH = 80


@dataclass(frozen=True, kw_only=True)
class _Downloaded:
    """What was done: `kept` is the backup of what there was before, None where nothing was sent."""

    changes: tuple[Change, ...]
    kept: Path | None = None
    left: tuple[Check, ...] = ()


def download_file(options: Namespace, text: Catalogue) -> int:
    """Check the file before anything is connected; then show, ask, back up, send and read again."""
    source = read_source(Path(options.file), profile_of(options).machine, text)
    with card_access.opened_card(options, text) as card:
        return _download(options, card, source, text)


def _download(options: Namespace, card: Card, source: Source, text: Catalogue) -> int:
    if not card.simulated:
        refuse_unsigned(card.machine)
    dialect = card.client.dialect
    _refuse_other_family(card)
    changes = planned(card.client, dialect, source.buffers)
    if not options.json:
        print("\n".join(_plan(card, source, changes, text)))
    found = _Downloaded(changes=changes)
    if any(change.differs for change in changes):
        if not agreed(options, card.machine.name, card.simulated, text, "download"):
            return 1
        kept = kept_before(options, card, read_whole(card, text, "configuration.reading", source.programs))
        left = _sent_and_read(card, changes, printable(options.file), undo_command(options, kept), text)
        found = _Downloaded(changes=changes, kept=kept, left=tuple(left))
    show(options, lambda: _fields(options, card, source, found, text), lambda: _lines(options, found, text))
    return 1 if found.left else 0


def _refuse_other_family(card: Card) -> None:
    """The file was read in the language of the family of the profile."""
    family, found = card.machine.controller.family, card.client.dialect.name
    if found != family:
        code = "controller.family_differs"
        raise RefusedError(Problem(code=code, where=card.address, value=found, limit=family))


def _sent_and_read(card: Card, changes: tuple[Change, ...], where: str, undo: str, text: Catalogue) -> list[Check]:
    """Send what differs, and return what then still does."""

    def work() -> None:
        with sending(card, "download.sending", undo, text) as seen:
            with_control(card, lambda: send(card.client, card.client.dialect, changes, where, seen))

    unread = text("download.unread", command=undo)
    return sent_then_read(work, lambda: differing(card.client, changes), unread)


def _plan(card: Card, source: Source, changes: tuple[Change, ...], text: Catalogue) -> list[str]:
    """Return what the check found, and what would be replaced by what."""
    lines = [card_line(card, text), *finding_lines(source.findings, text), ""]
    for change in changes:
        key = "same" if not change.differs else "new" if change.before is None else "replaced"
        facts = {"name": change.buffer.name, "before": len(change.before or ()), "count": len(change.wanted)}
        lines.append(text(f"download.buffer.{key}", **facts))
    running = may_run(card.client, tuple(change for change in changes if change.differs))
    if running:
        lines += broken(text("download.may_run", names=", ".join(running)), WIDTH)
    return lines


def _fields(
    options: Namespace, card: Card, source: Source, found: _Downloaded, text: Catalogue
) -> dict[str, object]:
    return {
        **card_fields(card),
        "file": options.file,
        "findings": finding_fields(source.findings, text),
        "buffers": [
            {
                "name": change.buffer.name,
                "line": int(change.buffer.place),
                "lines_before": len(change.before or ()),
                "lines_after": len(change.wanted),
                "sent": change.differs and found.kept is not None,
            }
            for change in found.changes
        ],
        "backup": found.kept and str(found.kept),
        "sent": len(sent_lines(found.changes)) if found.kept else 0,
        "differences": check_fields(found.left, text),
    }


def _lines(options: Namespace, found: _Downloaded, text: Catalogue) -> list[str]:
    if found.kept is None:
        return ["", text("download.nothing_to_send")]
    count = len(sent_lines(found.changes))
    done = text("download.not_all" if found.left else "download.done", count=count)
    after = broken(text("download.not_saved"), WIDTH)
    undo = text("configuration.restore_undo", command=undo_command(options, found.kept))
    return ["", *broken(done, WIDTH), *check_lines(found.left, text), "", *after, undo]
