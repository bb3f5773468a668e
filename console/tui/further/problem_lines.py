"""Problems in the place of what could not be read or computed."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.catalogue import Catalogue
from console.tui.lines import Line, hanging
from console.tui.theme import Token
from profiles.problem import Problem


def problem_lines(problems: Sequence[Problem], text: Catalogue, width: int) -> list[Line]:
    """Return each problem with its sentence."""
    return [row for problem in problems for row in hanging(("! ", Token.WARNING), text.problem(problem), width)]
