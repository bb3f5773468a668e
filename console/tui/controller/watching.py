"""The watch table: a few values, asked once a second in one short line, at rest and in motion alike."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.kept_files import folder_name, make_folder, path_exists, read_kept_values
from console.session.station.state import StationState
from console.text.catalogue import Catalogue
from console.tui.controller.errand import Errand
from console.tui.lines import NOTHING, Line, dim, fit_text, line, to_the_right
from console.tui.theme import Token
from drivers.errors import ControllerError
from drivers.requests.permitted_lines import RequestKind, parse_watch_item
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import SideLine
from profiles.files import printable, write_atomically
from profiles.problem import Problem, ProfileError

PERIOD_S = 1.0
A_LINE = 8  # items in one request
SLOW_LINE_MS = 50.0  # where a poll takes longer, one item is asked at a time while something moves
OLD_S = 5.0
_ITEM, _VALUE = 14, 16
FOLDER = "watch"
MOST = 24  # items in a table
_TITLE = "trilobe watch 1"


@dataclass(frozen=True, slots=True)
class WatchedItem:
    """One item, its newest value, when that came, and the least and the greatest number so far."""

    item: str
    text: str = ""
    at_s: float | None = None
    refused: bool = False
    least: float | None = None
    most: float | None = None


def watch_path(data: Path, machine: str) -> Path:
    """Return the file of the table of a machine."""
    return data / FOLDER / f"{folder_name(machine)}.json"


def read_watch(path: Path) -> tuple[str, ...]:
    """Return the items, none where there is no file.

    Raises ProfileError: `watch.unreadable`, it is not such a table; or as `read_regular_file`.
    """
    if not path_exists(path):
        return ()
    found = read_kept_values(path, "watch.unreadable")
    items = found.get("items") if isinstance(found, dict) and found.get("schema") == _TITLE else None
    if not isinstance(items, list) or len(items) > MOST or not all(isinstance(each, str) for each in items):
        raise ProfileError(Problem(code="watch.unreadable", where=printable(str(path)), value=_TITLE))
    return tuple(dict.fromkeys(items))


def write_watch(path: Path, items: tuple[str, ...]) -> None:
    """Write the items. Raises ProfileError: `file.not_writable`."""
    make_folder(path.parent)
    content = json.dumps({"schema": _TITLE, "items": list(items)}, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=True, private=True)


class WatchTable:
    """The items of one machine; read from its file when the table is first shown."""

    def __init__(self, data: Path, machine: str) -> None:
        self.selected = 0
        self.rows: tuple[WatchedItem, ...] = ()
        self.problems: tuple[Problem, ...] = ()
        self._path = watch_path(data, machine)
        self._read = False
        self._unread: tuple[Problem, ...] = ()
        self._errand: Errand[tuple[tuple[str, str | None], ...]] = Errand()
        self._asked_s, self._next = float("-inf"), 0

    def load(self) -> None:
        """Read the file, once."""
        if not self._read:
            self._read = True
            try:
                self.rows, self._unread = tuple(WatchedItem(item) for item in read_watch(self._path)), ()
            except ProfileError as error:
                self.problems = self._unread = tuple(error.problems)

    def add(self, typed: str, side: SideLine) -> None:
        """Add an item, at the end.

        Raises RefusedError: it cannot be watched; ProfileError: `watch.full`, `watch.twice`, or the file.
        """
        item = parse_watch_item(typed, side.dialect)
        self._require_read()
        if any(row.item == item for row in self.rows):
            raise ProfileError(Problem(code="watch.twice", value=item))
        if len(self.rows) >= MOST:
            raise ProfileError(Problem(code="watch.full", limit=f"<= {MOST}"))
        self._keep((*self.rows, WatchedItem(item)))
        self.selected = len(self.rows) - 1

    def remove(self) -> None:
        """Remove the selected item. Raises ProfileError: the file cannot be read or written."""
        self._require_read()
        self._keep(tuple(row for place, row in enumerate(self.rows) if place != self.selected))
        self.selected = max(min(self.selected, len(self.rows) - 1), 0)

    def move(self, by: int) -> None:
        """Select another item."""
        self.selected = max(min(self.selected + by, len(self.rows) - 1), 0)

    def follow(self, side: SideLine, state: StationState, now_s: float) -> None:
        """Take what was answered, and ask again when it is time."""
        if self._errand.running:
            return
        if self._errand.has_news:
            self._take(now_s)
        if self.rows and now_s - self._asked_s >= PERIOD_S:
            self._asked_s = now_s
            slow = state.may_move and state.round_trip_ms > SLOW_LINE_MS
            items = self._due_items(1 if slow else A_LINE)
            client = SideController(side, RequestKind.QUERY)
            self._errand.start(client, lambda: read_values(client, items))
            if not self._errand.running:
                self.follow(side, state, now_s)

    def _due_items(self, most: int) -> tuple[str, ...]:
        rows = [row for row in self.rows if not row.refused]
        if not rows:
            return ()
        first = self._next % len(rows)
        self._next = first + most
        return tuple(row.item for row in (rows[first:] + rows[:first])[:most])

    def _take(self, now_s: float) -> None:
        self.problems = self._errand.problems
        found = dict(self._errand.found or ()) if not self.problems else {}
        self.rows = tuple(_update_item(row, found, now_s) for row in self.rows)

    def _require_read(self) -> None:
        """Read again a file that could not be read: what may be in it is not written over."""
        if self._unread:
            self._read = False
            self.load()
        if self._unread:
            raise ProfileError(*self._unread)

    def _keep(self, rows: tuple[WatchedItem, ...]) -> None:
        write_watch(self._path, tuple(row.item for row in rows))
        self.rows, self.problems = rows, ()


def read_values(client: SideController, items: Sequence[str]) -> tuple[tuple[str, str | None], ...]:
    """Return the values of items, None for one that the controller does not have."""
    if not items:
        return ()
    try:
        return tuple(zip(items, client.query(*items), strict=True))
    except ControllerError:
        if len(items) == 1:
            return ((items[0], None),)
    return tuple(pair for item in items for pair in read_values(client, (item,)))


def _update_item(row: WatchedItem, found: dict[str, str | None], now_s: float) -> WatchedItem:
    if row.item not in found:
        return row
    text = found[row.item]
    if text is None:
        return replace(row, refused=True, at_s=now_s)
    number = _number(text)
    bounds = [each for each in (row.least, row.most, number) if each is not None]
    least, most = (min(bounds), max(bounds)) if bounds else (None, None)
    return replace(row, text=text.strip(), at_s=now_s, least=least, most=most)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def watch_lines(table: WatchTable, text: Catalogue, now_s: float, width: int) -> list[Line]:
    """Return the table, a row for each item; an old value is shown as old."""
    if not table.rows:
        return []
    head = [text(f"controller_page.watch.{name}") for name in ("item", "value", "least", "most")]
    widths = (_ITEM, _VALUE, _VALUE, _VALUE) if width >= _ITEM + 3 * _VALUE + 2 else (_ITEM, _VALUE)
    titles = (dim(to_the_right(each, _VALUE)) for each in head[1 : len(widths)])
    rows = [line(dim("  " + fit_text(head[0], _ITEM)), *titles)]
    for place, row in enumerate(table.rows):
        chosen = place == table.selected
        mark = ("▶ ", Token.ACTION) if chosen else dim("  ")
        item = (fit_text(row.item, _ITEM), Token.SELECTED if chosen else Token.TEXT)
        if row.refused:
            rows.append(line(mark, item, ("  " + text("controller_page.watch.refused"), Token.WARNING)))
            continue
        old = row.at_s is None or now_s - row.at_s > OLD_S
        value = row.text or NOTHING
        bounds = [NOTHING if each is None else f"{each:.10g}" for each in (row.least, row.most)]
        cells = [(to_the_right(value, _VALUE), Token.STALE if old and row.text else Token.TEXT)]
        cells += [dim(to_the_right(each, _VALUE)) for each in bounds[: len(widths) - 2]]
        rows.append(line(mark, item, *cells))
    return rows
