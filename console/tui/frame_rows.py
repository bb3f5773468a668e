"""The six rows of the frame on the screen: each sheet is as high as its message needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from operator import attrgetter

from console.session.station.state import StationState
from console.tui.frame import ROWS, Frame, age_of, frame_rows
from console.tui.lines import Line, Sheet
from console.tui.theme import Palette
from drivers.lathe.snapshot import Snapshot


class FrameRows:
    """The sheets of the rows, by name; those of `ABOVE` are over the page, those of `BELOW` under it."""

    ABOVE = ("state", "alarm", "pages")
    BELOW = ("next", "stop", "keys")

    def __init__(self, palette: Palette) -> None:
        self._sheets = {name: Sheet(palette, id=f"row-{name}", classes="row") for name in ROWS}
        self._shown: dict[str, Sequence[Line]] = {}

    def __getitem__(self, name: str) -> Sheet:
        return self._sheets[name]

    def find_sheets(self, names: Sequence[str]) -> list[Sheet]:
        """Return the sheets of these rows."""
        return [self._sheets[name] for name in names]

    def show(self, rows: Mapping[str, Sequence[Line]]) -> bool:
        """Show the lines; return whether a longer or shorter message changes the size of the page."""
        moved = False
        for name, lines in rows.items():
            if lines is self._shown.get(name):
                continue
            self._shown[name], sheet = lines, self._sheets[name]
            if len(lines) != max(len(sheet.lines), 1):
                sheet.styles.height = len(lines)
                moved = True
            sheet.show(lines)
        return moved


class MadeRows:
    """The lines of the rows as they were made last: they are made again when anything that they show changes."""

    def __init__(self) -> None:
        self._made_for: tuple[object, ...] = ()
        self._rows: dict[str, list[Line]] = {}

    def frame_lines(self, frame: Frame, width: int, height: int) -> dict[str, list[Line]]:
        """Return the lines of each row for this terminal size."""
        before, self._made_for = self._made_for, (*contents(frame), width, height)
        if len(before) != len(self._made_for) or not all(map(_is_unchanged, before, self._made_for)):
            self._rows = frame_rows(frame, width, height)
        return self._rows


def contents(frame: Frame) -> tuple[object, ...]:
    """Return everything that the rows show: all of a frame, and of what each poll renews what a row reads of it.

    Rows show no position, and of the times the minute and the age.
    """
    state, clock = frame.state, frame.clock
    polled: tuple[object, ...] = ()
    if state.snapshot is not None:
        polled = (*_POLLED(state.snapshot), *(axis.flags for axis in state.snapshot.axes))
    minute = (clock.date(), clock.hour, clock.minute, clock.tzinfo)
    words = (frame.text.language, frame.text.units)  # which the one catalogue of a screen changes in place
    return (*_FRAME(frame), *words, *_STATE(state), polled, minute, age_of(frame))


def _is_unchanged(before: object, now: object) -> bool:
    """Whether two values are the same; large ones, which are replaced and never changed, only as one object."""
    return before is now or (isinstance(now, str | int | float | tuple | frozenset) and before == now)


def _all_but(kind: type, *names: str) -> attrgetter[tuple[object, ...]]:
    return attrgetter(*(field.name for field in fields(kind) if field.name not in names))


_FRAME = _all_but(Frame, "state", "clock", "now_s")
_STATE = _all_but(StationState, "at_s", "snapshot", "seen")
_POLLED = _all_but(Snapshot, "asked_s", "at_s", "tool", "spindle", "carriage")
