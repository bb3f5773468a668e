"""Layout of the rows and the page between them, and the terminal sizes below which less can be done."""

from __future__ import annotations

from textual.geometry import Size

from console.tui.keymap import Action
from profiles.problem import Problem

SMALLEST = (60, 18)  # columns and rows below which no page is shown and nothing can be started
SMALLEST_TO_MOVE = (80, 24)  # columns and rows below which pages are shown, but motion cannot be commanded
WIDE = 140  # columns from which a page shows side by side what is behind a key elsewhere
TALL_ROWS = 36  # rows of the page from which it shows further panels below

CSS = """
Screen { layout: vertical; background: $background; color: $foreground; }
.row { height: 1; width: 1fr; }
#body { height: 1fr; width: 1fr; }
.page { height: 1fr; width: 1fr; }
#list, #small { height: 1fr; width: 1fr; padding: 0 1; display: none; }
.page.-away { display: none; }
.reading #list { display: block; }
.reading .page { display: none; }
.small .row, .small #body { display: none; }
.small #small { display: block; padding: 0; }
"""


def find_size_problems(action: Action, size: Size) -> tuple[Problem, ...]:
    """Return why nothing may be moved on a terminal of this size, empty where it may."""
    columns, rows = SMALLEST_TO_MOVE
    if action.moves and (size.width < columns or size.height < rows):
        return (Problem(code="screen.cramped", limit=f"{columns} x {rows}"),)
    return ()


def is_small(size: Size) -> bool:
    """Whether there is no room for a page."""
    return size.width < SMALLEST[0] or size.height < SMALLEST[1]
