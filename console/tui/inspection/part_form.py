"""Form of the page Inspect: what the certificate of the measured part calls it, and the gauge of the machine."""

from __future__ import annotations

from typing import Any

from textual.containers import Vertical

from console.session.data.kept_files import gauges_folder
from console.session.data.records import identify_part
from console.session.data.run_reader import story
from console.session.data.run_story import RunStory
from console.session.gauge_in_use import chosen_gauge, use_gauge
from console.session.part_identity import FIELDS, KEYS, PartIdentity, identity_of, identity_values
from console.text.recorded_words import identity_rows
from console.tui.entry import EntryLine
from console.tui.keymap import RowKey
from console.tui.lines import BLANK, Line, Sheet, clip_lines, dim, fit_text, line, wrap_line
from console.tui.records.background_reader import BackgroundReader
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from profiles.files import printable
from profiles.problem import Problem
from profiles.store import list_gauges

GAUGE = "gauge"  # the last row
_LABEL = 18  # cells
_ENTRY = 42
FORM_KEYS = (
    RowKey(action="inspect.up", shown="↑↓", words="key.list.choose", doubled=True),
    RowKey(action="inspect.next", shown="Enter", words="key.setup.edit"),
    RowKey(action="inspect.identify", shown="n", words="key.list.close"),
)
_ALLOWED = frozenset(f"inspect.{name}" for name in ("identify", "next", "up", "down", "page_up", "page_down"))
_ALLOWED |= {"inspect.first", "inspect.last"}


class PartForm(Vertical):
    """The fields in the place of the page; each is kept as it is confirmed. Without a part only the gauge."""

    DEFAULT_CSS = f"""
    PartForm {{
        height: 1fr;
        layers: base entry;
        #part-fields {{ height: 1fr; }}
        #part-entry {{ width: {_ENTRY}; }}
    }}
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(id="part-form")
        self._ui = ui
        self._fields = Sheet(ui.palette, id="part-fields", classes="panel")
        self._entry = EntryLine(id="part-entry")
        self._reader: BackgroundReader[RunStory] = BackgroundReader()
        self._run_id: str | None = None
        self._opened = self._selected = 0
        self._found: RunStory | tuple[Problem, ...] | None = None
        self._stated: dict[str, Any] = {}
        self._gauges: tuple[str | None, ...] = (None,)
        self._gauge: str | None = None
        self.display = False

    def compose(self) -> list[Sheet | EntryLine]:
        """Return the fields and the entry of one."""
        return [self._fields, self._entry]

    @property
    def is_open(self) -> bool:
        """Whether it is in the place of the page."""
        return self._run_id is not None

    @property
    def is_typing(self) -> bool:
        """Whether a value is being typed."""
        return self._entry.is_open

    @property
    def keys(self) -> tuple[RowKey, ...]:
        """The keys that can be used now."""
        return FORM_KEYS[1:2] if self.is_typing else FORM_KEYS

    def open(self, run_id: str) -> None:
        """Show what is recorded of the part of a run, "" without one; raises ProfileError as `chosen_gauge`."""
        data = self._ui.data
        self._gauges = (None, *(each.name for each in list_gauges(gauges_folder(data))))
        self._gauge = chosen_gauge(data).of(self._ui.control.state.machine)
        self._run_id, self._stated, self._found, self._selected = run_id, {}, None, 0
        self._opened += 1

    def close(self) -> None:
        """Show the page again."""
        self._entry.close()
        self._run_id = None

    def why_not(self, action: str) -> tuple[Problem, ...]:
        """Return why a key cannot be used while the form is open."""
        return () if action in _ALLOWED else (Problem(code="screen.close_identity"),)

    def act(self, action: str) -> None:
        """Choose a field, type its value, keep it; ProfileError: it cannot be used, SessionError: nor kept."""
        if action == "inspect.next" and self._rows[self._selected] == GAUGE:
            self._take_next_gauge()
        elif action == "inspect.next":
            self._take() if self.is_typing else self._type()
        elif action == "inspect.identify":
            self.close()
        elif not self.is_typing:
            by = {"inspect.up": -1, "inspect.down": 1}.get(action, len(self._rows))
            by = -by if action in ("inspect.first", "inspect.page_up") else by
            self._selected = min(max(self._selected + by, 0), len(self._rows) - 1)

    @property
    def _rows(self) -> tuple[str, ...]:
        return (*(KEYS if self._run_id else ()), GAUGE)

    def refresh_fields(self) -> None:
        """Bring the form up to date with the reader; called at each tick."""
        run_id = self._run_id
        if run_id is None:
            return
        if run_id:
            self._found = self._reader.answer((run_id, self._opened), lambda: story(self._ui.data, run_id))
        self._entry.keep_focus()
        width, height = max(self._fields.size.width, 1), max(self._fields.size.height, 1)
        text = self._ui.text
        self._fields.show(clip_lines(self.in_full(width), height, text("panel.more")), text("identity.title"))

    def next_words(self) -> str:
        """Return what to do in the form."""
        word = "gauge" if self._rows[self._selected] == GAUGE else "type" if self.is_typing else ""
        return self._ui.text(f"identity.next_{word}" if word else "identity.next")

    def in_full(self, width: int) -> list[Line]:
        """Return all rows of the form."""
        text = self._ui.text
        if isinstance(self._found, tuple):
            return problem_lines(self._found, text, width)
        if self._found is None and self._run_id:
            return [line(dim(text("records_page.reading")))]
        shown = {} if self._found is None else dict(identity_rows(self._identity, text))
        shown[text(f"identity.{GAUGE}")] = printable(self._gauge) if self._gauge else f"– ({text('judged.no_u')})"
        rows = [self._row(place, text(f"identity.{key}"), shown, width) for place, key in enumerate(self._rows)]
        return [*rows, BLANK, *wrap_line(text(f"help.identity.{self._rows[self._selected]}"), width, Token.DIM)]

    def _row(self, place: int, name: str, shown: dict[str, str], width: int) -> Line:
        words = f"{fit_text(name, _LABEL)}{shown.get(name, '–')}"
        if place == self._selected:
            return line((fit_text(f"▸ {words}", width), Token.SELECTED))
        return line(f"  {words}")

    @property
    def _identity(self) -> PartIdentity:
        assert isinstance(self._found, RunStory)
        return identity_of(self._found, self._stated) or PartIdentity()

    def _type(self) -> None:
        """Open the entry in the row of the selected field."""
        if not isinstance(self._found, RunStory):
            return
        key = KEYS[self._selected]
        value = getattr(self._identity, key)
        self._entry.max_length = FIELDS[key].longest
        self._entry.styles.offset = (_LABEL + 3, self._selected + 1)
        self._entry.begin("" if value is None else str(value))

    def _take(self) -> None:
        """Keep the typed value in the record of the run; an entry that cannot be used stays open."""
        assert isinstance(self._found, RunStory)
        values = identity_values({KEYS[self._selected]: self._entry.value})
        self._entry.close()
        if any(getattr(self._identity, key) != value for key, value in values.items()):
            identify_part(self._ui.data, self._found, self._stated | values)
            self._stated |= values
        self._selected = min(self._selected + 1, len(self._rows) - 1)

    def _take_next_gauge(self) -> None:
        """Let the next gauge measure the parts of this machine; ProfileError: its file is refused."""
        at = self._gauges.index(self._gauge) if self._gauge in self._gauges else 0
        self._gauge = self._gauges[(at + 1) % len(self._gauges)]
        use_gauge(self._ui.data, self._gauge, self._ui.control.state.machine)
