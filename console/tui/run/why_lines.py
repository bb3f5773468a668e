"""Why the actions of a page cannot be done now, each with all of its reasons: for the list that `w` shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from console.text.catalogue import Catalogue
from console.tui.keymap import Action
from console.tui.lines import BLANK, Line, dim, hanging, line
from console.tui.pages.fields import named
from console.tui.theme import Token
from profiles.problem import Problem


def why_lines(
    text: Catalogue, actions: tuple[Action, ...], why_not: Callable[[str], tuple[Problem, ...]], width: int
) -> list[Line]:
    """Return each action that is refused now with its reasons; nothing where none is."""
    rows = [row for action in actions for row in _of_action(text, action, why_not(action.id), width)]
    return [BLANK, line((text("run_page.why_not"), Token.TITLE)), *rows] if rows else []


def _of_action(text: Catalogue, action: Action, reasons: tuple[Problem, ...], width: int) -> Iterator[Line]:
    if not reasons:
        return
    yield line((f"✗ {action.shown} {text(f'key.{action.id}')}", Token.WARNING))
    for problem in dict.fromkeys(reasons):
        yield from hanging(dim("  "), text.problem(named(problem, text)), width)
