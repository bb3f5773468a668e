"""Numbers five rows high, to be read from a few metres away."""

from __future__ import annotations

from collections.abc import Sequence

from console.tui.lines import Line, Piece, dim, fit_text, to_the_right
from console.tui.theme import Token

ROWS = 5
LABEL_WIDTH, UNIT_WIDTH = 11, 4

_FORMS: dict[str, Sequence[str]] = {
    "0": ("###", "# #", "# #", "# #", "###"),
    "1": ("  #", "  #", "  #", "  #", "  #"),
    "2": ("###", "  #", "###", "#  ", "###"),
    "3": ("###", "  #", "###", "  #", "###"),
    "4": ("# #", "# #", "###", "  #", "  #"),
    "5": ("###", "#  ", "###", "  #", "###"),
    "6": ("###", "#  ", "###", "# #", "###"),
    "7": ("###", "  #", "  #", "  #", "  #"),
    "8": ("###", "# #", "###", "# #", "###"),
    "9": ("###", "# #", "###", "  #", "###"),
    "-": ("   ", "   ", "###", "   ", "   "),
    "–": ("   ", "   ", "###", "   ", "   "),
    "+": ("   ", " # ", "###", " # ", "   "),
    ".": (" ", " ", " ", " ", "#"),
    " ": ("   ", "   ", "   ", "   ", "   "),
}


def big_number(number: str, label: str, unit: str, width: int, token: Token = Token.STRONG) -> list[Line]:
    """Return a number right-aligned in `width` cells, its label on the left and its unit behind its foot.

    Where it does not fit, or has a sign without a form, it is one row of plain text.
    """
    room = width - LABEL_WIDTH - UNIT_WIDTH
    head, foot = dim(fit_text(label, LABEL_WIDTH)), dim(" " + fit_text(unit, UNIT_WIDTH - 1))
    if any(sign not in _FORMS for sign in number) or _cells(number) > room:
        return [(head, (to_the_right(number, max(room, 0)), token), foot)]
    rows: list[Line] = []
    for row in range(ROWS):
        dots = "  ".join("".join("██" if dot == "#" else "  " for dot in _FORMS[sign][row]) for sign in number)
        digits: Piece = (to_the_right(dots, room), token)
        last = row == ROWS - 1
        rows.append((head if row == ROWS // 2 else dim(" " * LABEL_WIDTH), digits, *((foot,) if last else ())))
    return rows


def _cells(number: str) -> int:
    return sum(2 * len(_FORMS[sign][0]) + 2 for sign in number) - 2
