"""Rows of a list around the selected one, and problems in the place of what could not be read or computed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from console.text.catalogue import Catalogue
from console.tui.lines import Line, Piece, dim, hanging, wrap_line
from console.tui.theme import Token
from profiles.problem import Problem


def problem_lines(
    problems: Iterable[Problem],
    text: Catalogue,
    width: int,
    mark: Piece = ("! ", Token.WARNING),
    token: Token = Token.TEXT,
) -> list[Line]:
    """Return each problem with its sentence, of this token, behind a mark."""
    return [row for problem in problems for row in hanging(mark, text.problem(problem), width, token)]


def wrap_problems(problems: Iterable[Problem], text: Catalogue, width: int) -> list[Line]:
    """Return the sentence of each problem as a warning."""
    return [row for problem in problems for row in wrap_line(text.problem(problem), width, Token.WARNING)]


def list_rows(rows: Sequence[Piece], selected: int, height: int, chosen: Token | None = None) -> list[Line]:
    """Return the rows around the selected one, which has a mark, and is shown as `chosen`."""
    first = max(min(selected - height // 2, len(rows) - height), 0)
    shown = list(enumerate(rows))[first : first + max(height, 1)]
    return [
        (("▶ ", Token.ACTION), (words, chosen or token)) if place == selected else (dim("  "), (words, token))
        for place, (words, token) in shown
    ]
