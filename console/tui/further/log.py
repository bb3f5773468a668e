"""Page Log: every command, stop, alarm and message of this session with its time, searched and exported."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

from console.session.station.history.session_log import LogEntry, SessionLog
from console.tui.entry import EntryLine
from console.tui.further.log_lines import export_log, find_entries, log_part
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, line, wrap_line
from console.tui.page import Page
from console.tui.records.background_reader import BackgroundReader
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.files import printable
from profiles.problem import Problem

STEPS = {"log.up": -1, "log.down": 1, "log.page_up": -1, "log.page_down": 1}


class LogPage(Page):
    """Nothing on it moves anything. It follows its newest entry until somebody scrolls up."""

    name_ = PageName.LOG

    DEFAULT_CSS = """
    LogPage {
        layers: base entry;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        #log-list { height: 1fr; }
        #log-entry { width: 60%; offset: 3 1; }
    }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._list = Sheet(ui.palette, id="log-list")
        self._entry = EntryLine(id="log-entry")
        self.panels = (self._list, self._entry)
        self._words = ""
        self._end: int | None = None  # past the newest entry shown, among all that were found in the session
        self._seen = 0
        self._found: tuple[object, tuple[LogEntry, ...]] = (None, ())
        self._exports: BackgroundReader[Path] = BackgroundReader()
        self._export: tuple[datetime, SessionLog] | None = None

    def act(self, action: str) -> None:
        """Scroll, search, export."""
        if self._entry.is_open:
            if action == "log.take":
                self._words, self._end = self._entry.close(), None
        elif self.ui.answers(self.why_not(action, self.ui.view)):
            return
        elif action == "log.search":
            self._entry.begin(self._words)
        elif action == "log.export":
            self._export = datetime.now(), self.ui.log
        else:
            self._scroll(action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a key has no effect now."""
        if action == "log.take" and not self._entry.is_open:
            return (Problem(code="screen.log_no_entry"),)
        if action == "log.export" and self._export is not None:
            return (Problem(code="screen.log_exporting"),)
        return ()

    def show(self, view: View) -> None:
        """Show the entries that fit, up to the one that was scrolled to."""
        self._entry.keep_focus()
        self._answer_export()
        log, size, text = self._shown_log, self._list.size, self.ui.text
        end = None if self._end is None else self._end - log.dropped
        part = log_part(log, end, text, max(size.width, 1), size.height - self._entry.is_open)
        self._seen = part.end - part.first
        if self._end is not None and part.end:
            self._end = log.dropped + part.end
        none = self._words and not log.entries
        rows = wrap_line(text("log_page.none_found"), max(size.width, 1), Token.DIM) if none else part.lines
        above, below = part.first, len(log.entries) - part.end
        hidden = [f"↑ {text('jobs_page.above', count=above)}"] if above > 0 else []
        hidden += [f"↓ {text('jobs_page.below', count=below)}"] if below > 0 else []
        prompt: list[Line] = [line(("/ ", Token.KEY))] if self._entry.is_open else []
        self._list.show([*prompt, *rows], self._title(log), "  ".join(hidden))

    @property
    def field(self) -> FieldKind:
        """Free text while the words of a search are typed."""
        return FieldKind.TEXT if self._entry.is_open else FieldKind.NONE

    def next_step(self, view: View) -> Line:
        """Return what the keys do."""
        name = "typing" if self._entry.is_open else "found" if self._words else "list"
        return line((self.ui.text(f"log_page.next.{name}"), Token.ACTION))

    def leave(self) -> None:
        """End an entry; show the end of the log the next time."""
        self._entry.close()
        self._end = None

    @property
    def _shown_log(self) -> SessionLog:
        """The log, of a search with what it found alone."""
        log = self.ui.log
        if not self._words:
            return log
        asked = (log.entries, self._words, self.ui.text.language)
        if self._found[0] != asked:
            self._found = asked, find_entries(log.entries, self._words, self.ui.text)
        return replace(log, entries=self._found[1], dropped=0)

    def _title(self, log: SessionLog) -> str:
        text = self.ui.text
        if self._words:
            count = len(log.entries)
            return text(
                "log_page.found", words=printable(self._words, 40), count=count, all=len(self.ui.log.entries)
            )
        title = text("alarms_page.log_title", count=len(log.entries))
        return f"{title} · {text('alarms_page.log_dropped', count=log.dropped)}" if log.dropped else title

    def _scroll(self, action: str) -> None:
        log = self._shown_log
        newest = log.dropped + len(log.entries)
        by = STEPS.get(action, 0) * (max(self._seen // 2, 1) if "page" in action else 1)  # half: none is skipped
        if action == "log.first":
            self._end = log.dropped + 1
        elif action == "log.last":
            self._end = None
        else:
            end = (newest if self._end is None else self._end) + by
            self._end = None if end >= newest else max(end, log.dropped + 1)

    def _answer_export(self) -> None:
        """Say where the file is once it is written: a slow disk delays no key and no tick."""
        if self._export is None:
            return
        at, log = self._export
        machine, text = self.ui.machine.machine.name, self.ui.text
        written = self._exports.answer(at, lambda: export_log(self.ui.data, log, machine, at, text))
        if written is None:
            return
        self._export = None
        if isinstance(written, Path):
            self.ui.say("screen.log_exported", value=printable(str(written)))
        else:
            self.ui.key_answer = tuple(written)
