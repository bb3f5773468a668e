"""Text of the log of this session: the entries that fit a panel, found by their words, or written to a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from console.escaping import escaped_line
from console.session.data.kept_files import make_folder
from console.session.station.history.session_log import LogEntry, LogKind, SessionLog
from console.text.catalogue import Catalogue
from console.text.recorded_words import command_words
from console.tui.lines import Line, dim, fit_text, hanging, wrap_line
from console.tui.pages.alarm_lines import clock
from console.tui.pages.fields import name_field
from console.tui.theme import Token
from profiles.files import write_atomically

_TIME, _KIND = 9, 13
_TOKENS = {
    LogKind.RAISED: Token.ALARM,
    LogKind.STOPPED: Token.STRONG,
    LogKind.MESSAGE: Token.WARNING,
    LogKind.REFUSED: Token.WARNING,
}
_UNITS = {"tool": "mm", "carriage": "mm", "spindle": "deg"}


@dataclass(frozen=True, slots=True, kw_only=True)
class LogPart:
    """What is seen of a log: its lines, and the places of the first and past the last entry."""

    lines: list[Line]
    first: int
    end: int


def log_part(log: SessionLog, end: int | None, text: Catalogue, width: int, height: int) -> LogPart:
    """Return the entries up to the place `end` that fit, to the newest without one; cost by what is shown."""
    entries = log.entries
    if not entries:
        return LogPart(lines=wrap_line(text("alarms_page.log_empty"), width, Token.DIM), first=0, end=0)
    end = len(entries) if end is None else min(max(end, 1), len(entries))
    rows: list[Line] = []
    first = end
    while first > 0 and len(rows) < height:
        first -= 1
        rows = [*_entry_lines(entries[first], text, width), *rows]
    if len(rows) >= height:
        return LogPart(lines=rows[-height:] if height > 0 else [], first=first, end=end)
    while end < len(entries) and len(rows) < height:  # the oldest ones: fill the panel from above
        rows += _entry_lines(entries[end], text, width)
        end += 1
    return LogPart(lines=rows[:height], first=first, end=end)


def _entry_lines(entry: LogEntry, text: Catalogue, width: int) -> list[Line]:
    token = _TOKENS.get(entry.kind, Token.TEXT)
    kind = text(f"alarms_page.log.{entry.kind}")
    times = f" ×{entry.times}" if entry.times > 1 else ""
    words = entry_words(entry, text) + times
    return hanging(dim(fit_text(clock(entry.at), _TIME) + fit_text(kind, _KIND)), words, width, token)


def entry_words(entry: LogEntry, text: Catalogue) -> str:
    """Return an entry in words, without its time."""
    if entry.problem is not None:
        words = text.problem(name_field(entry.problem, text))
        return text("alarms_page.log_alarm", number=entry.number, words=words) if entry.number else words
    match entry.kind:
        case LogKind.STOPPED:
            return text.reason(entry.word)
        case LogKind.REST:
            return text("alarms_page.log_rest", seconds=entry.word)
        case LogKind.INSTRUCTOR:
            return entry.word
    words = command_words(entry.word, text)
    if not entry.axis:
        return words
    axis = text(f"align_page.axis.{entry.axis}")
    return f"{words}: {axis} {entry.distance:+.3f} {_UNITS.get(entry.axis, '')}".rstrip()


FOLDER = "logs"
_DATE, _WORD = 24, 14


def find_entries(entries: Sequence[LogEntry], words: str, text: Catalogue) -> tuple[LogEntry, ...]:
    """Return the entries with every one of these words in what is shown of them; all of them without words."""
    wanted = words.casefold().split()
    if not wanted:
        return tuple(entries)
    return tuple(each for each in entries if all(word in _searchable_text(each, text) for word in wanted))


def _searchable_text(entry: LogEntry, text: Catalogue) -> str:
    kind = text(f"alarms_page.log.{entry.kind}")
    return f"{entry.at:%H:%M:%S} {kind} {entry_words(entry, text)}".casefold()


def export_log(data: Path, log: SessionLog, machine: str, now: datetime, text: Catalogue) -> Path:
    """Write every entry that is kept into a new text file in the data folder, and return it.

    Raises ProfileError: `file.exists` for a second export in one second, `file.not_writable`.
    """
    head = [
        text("log_page.export_title", machine=machine, date=f"{now:%Y-%m-%d %H:%M:%S}"),
        *([text("alarms_page.log_dropped", count=log.dropped)] if log.dropped else []),
        "",
    ]
    path = data / FOLDER / f"session-{now:%Y%m%d-%H%M%S}.txt"
    make_folder(path.parent)
    rows = [*head, *(log_row(entry, text) for entry in log.entries)]
    content = "".join(f"{escaped_line(row)}\n" for row in rows)
    write_atomically(path, content.encode("utf-8"), overwrite=False, private=True)
    return path


def log_row(entry: LogEntry, text: Catalogue) -> str:
    """Return an entry on one row, with its whole date."""
    times = f" ×{entry.times}" if entry.times > 1 else ""
    kind = text(f"alarms_page.log.{entry.kind}")
    return f"{entry.at.isoformat(timespec='seconds'):{_DATE}}{kind:{_WORD}}{entry_words(entry, text)}{times}"
