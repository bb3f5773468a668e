"""The log as text: found by its words, and written to a file."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from console.escaping import escaped_line
from console.session.data.kept_files import make_folder
from console.session.station.history.session_log import LogEntry, SessionLog
from console.text.catalogue import Catalogue
from console.tui.further.log_lines import entry_words
from profiles.files import write_atomically

FOLDER = "logs"
_TIME, _KIND = 24, 14


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
    return f"{entry.at.isoformat(timespec='seconds'):{_TIME}}{kind:{_KIND}}{entry_words(entry, text)}{times}"
