"""Page Alarms: those that stand and those that are over, the selected one in full."""

from __future__ import annotations

from textual.widget import Widget

from console.session.station.history.alarm_history import AlarmEntry, AlarmHistory, AlarmState
from console.tui.further.log_lines import log_part
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, clip_lines, line, wrap_line
from console.tui.page import Page, move_selection, rows_moved
from console.tui.pages.alarm_lines import (
    alarm_lines,
    all_lines,
    frequent_lines,
    rate_words,
    title_words,
    whole_lines,
    whole_title,
    window,
)
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.problem import Problem

_ROOMY_ROWS = 22  # rows of the page from which the most frequent alarms have a panel


class AlarmsPage(Page):
    """Nothing on it moves anything. The selection stays on its alarm; without one it is on the foremost."""

    name_ = PageName.ALARMS

    DEFAULT_CSS = """
    AlarmsPage {
        layout: vertical;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        #alarms-list { height: 1fr; }
        #alarms-whole { height: 8; }
        #alarms-frequent { height: 5; display: none; }
        #alarms-log { height: 40%; display: none; }
    }
    AlarmsPage.-tall #alarms-log { display: block; }
    AlarmsPage.-roomy #alarms-frequent { display: block; }
    AlarmsPage.-empty #alarms-whole { display: none; }
    AlarmsPage.-empty #alarms-frequent { display: none; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._list, self._whole, self._frequent, self._log = (
            Sheet(ui.palette, id=f"alarms-{name}") for name in ("list", "whole", "frequent", "log")
        )
        self.panels = (self._list, self._whole, self._frequent, self._log)
        self._number: int | None = None

    def act(self, action: str) -> None:
        """Select, acknowledge all, show the log."""
        if action == "alarms.log":
            self.ui.go(PageName.LOG)
        elif action == "alarms.all":
            self._acknowledge_all()
        else:
            self._select(action)

    def point(self, panel: Widget, row: int) -> None:
        """Choose the alarm in a row that was clicked, below the heading."""
        listed = self._history.list_entries
        place = window(len(listed), self._place, self._list.size.height) + row - 1
        if panel is self._list and row > 0 and place < len(listed):
            self._number = listed[place].number if place else None

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why nothing can be acknowledged: no alarm waits."""
        if action != "alarms.all":
            return ()
        return () if self._waiting() else (Problem(code="screen.nothing_to_acknowledge"),)

    def show(self, view: View) -> None:
        """Show the newest state."""
        self._show_alarms(view)
        if self.has_class("-tall"):
            log, size = self.ui.log, self._log.size
            part = log_part(log, None, self.ui.text, max(size.width, 1), size.height)
            self._log.show(part.lines, self.ui.text("alarms_page.log_title", count=len(log.entries)), "")

    def fit(self) -> None:
        """Show the most frequent alarms, and the end of the log, where there is room."""
        super().fit()
        self.set_class(self.size.height >= _ROOMY_ROWS, "-roomy")

    @property
    def chosen_alarm(self) -> Problem | None:
        """The selected alarm where it waits to be acknowledged."""
        entry = self._entry
        waits = entry is not None and not entry.is_past and not entry.alarm.acknowledged
        return entry.problem if entry is not None and waits else None

    def next_step(self, view: View) -> Line:
        """Return what the keys do."""
        entry = self._entry
        word = "none" if entry is None else str(entry.state)
        if word == AlarmState.RETURNED:
            word = "new"
        number = 0 if entry is None else entry.number
        return line((self.ui.text(f"alarms_page.next.{word}", number=number), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return the selected alarm, the rate and the most frequent ones, uncut."""
        return all_lines(self._history, self._entry, view.now_s, self.ui.text, width)

    def leave(self) -> None:
        """Show the foremost alarm the next time."""
        self._number = None

    @property
    def _history(self) -> AlarmHistory:
        return self.ui.log.alarms

    @property
    def _place(self) -> int:
        listed = self._history.list_entries
        return next((place for place, entry in enumerate(listed) if entry.number == self._number), 0)

    @property
    def _entry(self) -> AlarmEntry | None:
        listed = self._history.list_entries
        return listed[self._place] if listed else None

    def _select(self, action: str) -> None:
        listed = self._history.list_entries
        if not listed:
            return
        by = rows_moved(action, max(self._list.size.height - 2, 1)) or 0
        place = move_selection(self._place, by, len(listed))
        self._number = listed[place].number if place else None

    def _acknowledge_all(self) -> None:
        from console.session.station.commands import Acknowledge  # not for the first paint

        if waiting := self._waiting():
            self.ui.control.post(Acknowledge(shown=waiting))
        else:
            self.ui.say("screen.nothing_to_acknowledge")

    def _waiting(self) -> tuple[Problem, ...]:
        return tuple(each.problem for each in self._history.standing if not each.alarm.acknowledged)

    def _show_alarms(self, view: View) -> None:
        text, history, entry = self.ui.text, self._history, self._entry
        width, height = self._list.size
        self.set_class(entry is None, "-empty")
        if entry is None:
            rows = wrap_line(text("alarms_page.none"), max(width, 1), Token.DIM)
            self._list.show(rows[:height], title_words(history, text), rate_words(history, view.now_s, text))
        else:
            rows = alarm_lines(history, self._place, text, width, height)
            rate = rate_words(history, view.now_s, text)
            count, first = len(history.list_entries), window(len(history.list_entries), self._place, height)
            hidden = self._describe_hidden_rows(first, count - first - max(height - 1, 1))
            self._list.show(rows, title_words(history, text), f"{rate}  {hidden}".rstrip())
            whole = whole_lines(history, entry, text, max(self._whole.size.width, 1))
            lines = clip_lines(whole, self._whole.size.height, text("panel.more"))
            self._whole.show(lines, whole_title(entry, text), "")
        frequent = frequent_lines(history, text, self._frequent.size.width)
        self._frequent.show(frequent, text("alarms_page.frequent"), "")

    def _describe_hidden_rows(self, above: int, below: int) -> str:
        text = self.ui.text
        said = [f"↑ {text('jobs_page.above', count=above)}"] if above > 0 else []
        said += [f"↓ {text('jobs_page.below', count=below)}"] if below > 0 else []
        return "  ".join(said)
