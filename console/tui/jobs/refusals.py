"""What a key of the page Jobs does, and why it can do nothing now: one answer for the key and for the palette."""

from __future__ import annotations

from collections.abc import Callable

from console.tui.jobs import changes
from console.tui.jobs.shelf import Shelf
from console.tui.ui_context import UiContext, View, locked
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry

OPENS = "screen.open_moving", "screen.open_armed"
CHANGES = "screen.jobs_moving", "screen.jobs_armed"  # what is written to disk waits for rest
ENDS = {"jobs.first": -1, "jobs.last": 1}
PAGES = {"jobs.page_up": -1, "jobs.page_down": 1}
STEPS = {"jobs.up": -1, "jobs.down": 1}
READS = ("jobs.open", "jobs.copy", "jobs.new", "jobs.search", "jobs.sort", "jobs.export")
"""Actions that change nothing on disk, but for the copy of an export."""

_MOVES = (*STEPS, *PAGES, *ENDS)
_OPENING = ("jobs.open", "jobs.copy", "jobs.new")
_OF_IMPORTS = ("jobs.open", "jobs.path", "jobs.back", "jobs.import")
_REFUSES: dict[str, Callable[[UiContext, LibraryEntry], None]] = {
    "jobs.rename": changes.rename_refused,
    "jobs.delete": changes.delete_refused,
    "jobs.note": lambda _, entry: changes.own_or_refused(entry),
    "jobs.tags": lambda _, entry: changes.own_or_refused(entry),
}


def refused_now(ui: UiContext, view: View, action: str, shelf: Shelf, *, importing: bool) -> tuple[Problem, ...]:
    """Return why an action can do nothing now, or nothing to the selected job; empty where it can."""
    if importing and action not in (*_MOVES, *_OF_IMPORTS):
        return (Problem(code="screen.jobs_list_first"),)
    if action == "jobs.path" and not importing:
        return (Problem(code="screen.jobs_import_only"),)
    changing = action not in (*_MOVES, *READS, "jobs.back")
    if action in _OPENING or changing:
        if refused := locked(view.state, *(OPENS if action in _OPENING else CHANGES)):
            return (refused,)
    entry = shelf.entry
    if entry is None or importing:
        return ()
    loaded = shelf.load(entry) if action in ("jobs.open", "jobs.copy") else None
    return loaded if isinstance(loaded, tuple) else _change_refused(ui, action, entry)


def _change_refused(ui: UiContext, action: str, entry: LibraryEntry) -> tuple[Problem, ...]:
    try:
        if refuses := _REFUSES.get(action):
            refuses(ui, entry)
    except ProfileError as error:
        return tuple(error.problems)
    return ()
