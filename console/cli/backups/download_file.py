"""`console controller download`: the programs of a file are sent to the controller, and read again."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

from console.cli.backups.way_back import kept_before, read_whole, sending, sent_then_read, undo_command
from console.cli.library import profile_of, refuse_unsigned
from console.cli.machine import card_access
from console.cli.machine.card_access import ConnectedController, card_fields, card_line, with_control
from console.cli.output import confirm_motion, show
from console.cli.part.check_program_report import finding_fields, finding_lines, finding_sentence
from console.cli.part.program_file import checked_file, read_file
from console.text.catalogue import Catalogue
from console.text.checks import check_fields, check_lines
from console.text.columns import wrap_text
from drivers.commissioning.check import Check
from drivers.commissioning.downloadable import badly_formed, refusals
from drivers.commissioning.downloading import BufferChange, differing, may_run, plan_download, send, sent_lines
from drivers.errors import RefusedError
from drivers.pmac.analysis.findings import ProgramFinding
from drivers.pmac.analysis.program import refused_findings
from drivers.pmac.buffer_text import BufferKind, TextBuffer
from profiles.files import printable
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

WIDTH = 80
MOST_SAID = 20
"""Reasons that are named one by one."""


@dataclass(frozen=True, kw_only=True)
class _DownloadResult:
    """What was done: `kept` is the backup of what there was before, None where nothing was sent."""

    changes: tuple[BufferChange, ...]
    kept: Path | None = None
    left: tuple[Check, ...] = ()


@dataclass(frozen=True, kw_only=True)
class DownloadSource:
    """What a file has to send, and the warnings and notices of its check."""

    buffers: tuple[TextBuffer, ...]
    findings: tuple[ProgramFinding, ...]

    @property
    def programs(self) -> tuple[int, ...]:
        """The numbers of its motion programs."""
        return tuple(each.number for each in self.buffers if each.kind is BufferKind.PROGRAM)


def read_source(path: Path, machine: MachineProfile, text: Catalogue) -> DownloadSource:
    """Read a file and check it; nothing is sent.

    Raises:
        ProblemError: as `checked_file`.
        RefusedError: `download.check`, what the check refuses; and the codes of `refusals` and `badly_formed`.
    """
    where = printable(str(path))
    read, refused = read_file(path, machine)
    findings = tuple(refused_findings(refused))
    if any(buffer.kind is BufferKind.PROGRAM for buffer in read.source.buffers):
        findings = checked_file(path, machine).findings
    outside = {line.place for line in read.source.outside}
    problems = [
        *refusals(read.source, where, machine.controller.family),
        *(
            Problem(code="download.check", where=where, value=finding_sentence(finding, text))
            for finding in findings
            if finding.severity is Severity.REFUSAL and not (finding.lines and outside.issuperset(finding.lines))
        ),
    ]
    problems = problems or list(badly_formed(read.source.buffers, where))
    _refuse(problems, where)
    return DownloadSource(buffers=read.source.buffers, findings=findings)


def _refuse(said: list[Problem], where: str) -> None:
    if len(said) > MOST_SAID:
        more = Problem(code="download.more", where=where, value=str(len(said) - MOST_SAID))
        said = [*said[:MOST_SAID], more]
    if said:
        raise RefusedError(*said)


def download_file(options: Namespace, text: Catalogue) -> int:
    """Check the file before anything is connected; then show, ask, back up, send and read again."""
    source = read_source(Path(options.file), profile_of(options).machine, text)
    with card_access.opened_card(options, text) as card:
        return _download(options, card, source, text)


def _download(options: Namespace, card: ConnectedController, source: DownloadSource, text: Catalogue) -> int:
    if not card.simulated:
        refuse_unsigned(card.machine)
    dialect = card.client.dialect
    _refuse_other_family(card)
    changes = plan_download(card.client, dialect, source.buffers)
    if not options.json:
        print("\n".join(_plan(card, source, changes, text)))
    found = _DownloadResult(changes=changes)
    if any(change.differs for change in changes):
        if not confirm_motion(options, card.machine.name, card.simulated, text, "download"):
            return 1
        kept = kept_before(options, card, read_whole(card, text, "configuration.reading", source.programs))
        left = _sent_and_read(card, changes, printable(options.file), undo_command(options, kept), text)
        found = _DownloadResult(changes=changes, kept=kept, left=tuple(left))
    show(options, lambda: _fields(options, card, source, found, text), lambda: _lines(options, found, text))
    return 1 if found.left else 0


def _refuse_other_family(card: ConnectedController) -> None:
    """The file was read in the language of the family of the profile."""
    family, found = card.machine.controller.family, card.client.dialect.name
    if found != family:
        code = "controller.family_differs"
        raise RefusedError(Problem(code=code, where=card.address, value=found, limit=family))


def _sent_and_read(
    card: ConnectedController, changes: tuple[BufferChange, ...], where: str, undo: str, text: Catalogue
) -> list[Check]:
    """Send what differs, and return what then still does."""

    def work() -> None:
        with sending(card, "download.sending", undo, text) as seen:
            with_control(card, lambda: send(card.client, card.client.dialect, changes, where, seen))

    unread = text("download.unread", command=undo)
    return sent_then_read(work, lambda: differing(card.client, changes), unread)


def _plan(
    card: ConnectedController, source: DownloadSource, changes: tuple[BufferChange, ...], text: Catalogue
) -> list[str]:
    """Return what the check found, and what would be replaced by what."""
    lines = [card_line(card, text), *finding_lines(source.findings, text), ""]
    for change in changes:
        key = "same" if not change.differs else "new" if change.before is None else "replaced"
        facts = {"name": change.buffer.name, "before": len(change.before or ()), "count": len(change.wanted)}
        lines.append(text(f"download.buffer.{key}", **facts))
    running = may_run(card.client, tuple(change for change in changes if change.differs))
    if running:
        lines += wrap_text(text("download.may_run", names=", ".join(running)), WIDTH)
    return lines


def _fields(
    options: Namespace, card: ConnectedController, source: DownloadSource, found: _DownloadResult, text: Catalogue
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


def _lines(options: Namespace, found: _DownloadResult, text: Catalogue) -> list[str]:
    if found.kept is None:
        return ["", text("download.nothing_to_send")]
    count = len(sent_lines(found.changes))
    done = text("download.not_all" if found.left else "download.done", count=count)
    after = wrap_text(text("download.not_saved"), WIDTH)
    undo = text("configuration.restore_undo", command=undo_command(options, found.kept))
    return ["", *wrap_text(done, WIDTH), *check_lines(found.left, text), "", *after, undo]
