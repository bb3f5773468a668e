"""Chooser of the page Inspect: the recorded part of the same job to compare with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.data.measured_part import RecordedPart
from console.session.data.run_reader import measured_parts, story
from console.session.learning.evaluated_part import EvaluatedPart, evaluate_part
from console.session.station.state import MeasuredPart
from console.text.along_length import ront_words
from console.text.recorded_words import local
from console.tui.keymap import RowKey
from console.tui.lines import Line, Sheet, dim, fit_text, justify_line, line, wrap_line
from console.tui.pages.inspect_lines import point_words
from console.tui.records.background_reader import BackgroundReader
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from profiles.files import printable
from profiles.problem import Problem, ProfileError

_MARK_CELLS = 2
MOST_PARTS = 200
"""The newest parts that are offered."""

KEYS = frozenset(
    f"inspect.{name}" for name in ("beside", "next", "up", "down", "page_up", "page_down", "first", "last")
)
"""Actions of the chooser."""

OPEN_KEYS = (
    RowKey(action="inspect.up", shown="↑↓", words="key.list.choose", doubled=True),
    RowKey(action="inspect.next", shown="Enter", words="key.list.take"),
    RowKey(action="inspect.beside", shown="b", words="key.list.close"),
)


class PartChooser(Sheet):
    """The parts in the place of the page, newest first; the first row is the part before compensation again."""

    DEFAULT_CSS = "PartChooser { height: 1fr; }"

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui.palette, id="part-chooser", classes="panel")
        self._ui = ui
        self._lists: BackgroundReader[list[RecordedPart]] = BackgroundReader()
        self._traces: BackgroundReader[EvaluatedPart] = BackgroundReader()
        self._beside: MeasuredPart | None = None
        self._found: list[RecordedPart] | tuple[Problem, ...] | None = None
        self._opened = self._selected = 0
        self._taken: RecordedPart | None = None
        self.display = False

    @property
    def is_open(self) -> bool:
        """Whether it is in the place of the page."""
        return self._beside is not None

    def open(self, part: MeasuredPart) -> None:
        """Show the other parts of its job as they are recorded now."""
        self._beside, self._found, self._selected = part, None, 0
        self._opened += 1

    def close(self) -> None:
        """Show the page again."""
        self._beside = None

    @property
    def page_rows(self) -> int:
        """Rows that PgUp and PgDn go."""
        return max(self.size.height - 1, 1)

    def step(self, by: int) -> None:
        """Select another part."""
        last = len(self._found) if isinstance(self._found, list) else 0
        self._selected = min(max(self._selected + by, 0), last)

    def why_not(self, action: str) -> tuple[Problem, ...]:
        """Return why a key cannot be used while the chooser is open."""
        return () if action in KEYS else (Problem(code="screen.close_parts"),)

    def take(self) -> None:
        """Compare with the selected part, or with none of the record."""
        listed = self._found if isinstance(self._found, list) else []
        self._taken = listed[self._selected - 1] if 0 < self._selected <= len(listed) else None
        self.close()

    def forget(self) -> None:
        """Compare with no recorded part: another part was measured."""
        self._taken = None

    def take_choice(self) -> EvaluatedPart | None:
        """Return the part that was chosen, None for none, and while it is read; called at each tick.

        One that cannot be read is reported, and no longer chosen.
        """
        if self._taken is None:
            return None
        point = self._taken
        found = self._traces.answer((point.run_id, point.part), lambda: read_other_part(self._ui.data, point))
        if isinstance(found, tuple):
            self._ui.key_answer, self._taken = found, None
            return None
        return found

    def refresh_list(self) -> None:
        """Bring the list up to date with the reader, and paint what changed."""
        if self._beside is None:
            return
        job, own, machine = self._beside.job.name, self._beside.run_id, self._ui.machine.machine.name
        simulated = self._ui.view.state.simulated

        def read() -> list[RecordedPart]:
            found = measured_parts(self._ui.data, job, machine, simulated, MOST_PARTS)
            return [point for point in reversed(found) if point.run_id != own]

        self._found = self._lists.answer((job, machine, simulated, own, self._opened), read)
        self.step(0)
        text, width, height = self._ui.text, max(self.size.width, 1), max(self.size.height, 1)
        rows = self._rows(width)
        first = min(max(self._selected - height // 2, 0), max(len(rows) - height, 0))
        count = len(self._found) if isinstance(self._found, list) else 0
        title = text("inspect_page.parts", job=printable(job, 40))
        self.show(rows[first : first + height], title, text("inspect_page.parts_place", count=count))

    def next_words(self) -> str:
        """Return what to do in the chooser."""
        none = isinstance(self._found, list) and not self._found
        return self._ui.text("inspect_page.next_no_parts" if none else "inspect_page.next_parts")

    def in_full(self, width: int) -> list[Line]:
        """Return all rows of the list."""
        return self._rows(width)

    def _rows(self, width: int) -> list[Line]:
        text, found = self._ui.text, self._found
        if isinstance(found, tuple):
            return problem_lines(found, text, width)
        rows = [self._row(0, line(text("inspect_page.parts_none")), line(), width)]
        if found is None:
            return [*rows, line(dim(text("records_page.reading")))]
        if not found:
            return [*rows, *wrap_line(text("inspect_page.no_parts"), width, Token.DIM)]
        for place, point in enumerate(found, start=1):
            name = f"{local(point.at)}  {printable(point_words(point, text), 40)}  {printable(point.part, 12)}"
            mark = {True: "✓", False: "✗", None: "·"}[None if point.tolerance_um is None else point.is_round]
            rows.append(self._row(place, line(name), line(f" {ront_words(point.worst[0], text)} {mark}"), width))
        return rows

    def _row(self, place: int, left: Line, right: Line, width: int) -> Line:
        chosen = place == self._selected
        if not chosen:
            return (dim(" " * _MARK_CELLS), *justify_line(left, right, max(width - _MARK_CELLS, 0)))
        words = "".join(piece for piece, _ in justify_line(left, right, max(width - _MARK_CELLS, 0)))
        return line((fit_text(f"▸ {words}", width), Token.SELECTED))


def read_other_part(data: Path, point: RecordedPart) -> EvaluatedPart:
    """Read a part, judged at spindle angles.

    Raises SessionError: as `story`, and `inspect.no_trace`; ProfileError: its trace cannot be read.
    """
    run = story(data, point.run_id)
    products = [each for each in run.parts if each.product and each.part == point.part]
    found = None
    if products:
        part = replace(point, trace=products[-1].trace, trace_name=products[-1].trace_name, data=products[-1].data)
        found = evaluate_part(part, run.setup, "result", on_spindle=True)
    if found is None:
        raise ProfileError(Problem(code="inspect.no_trace", key=printable(point.run_id, 8)))
    return found
