"""Plain ASCII in the place of frames, marks and dots, for terminals without them; every sign keeps its cells.

A filter on the lines as Textual sends them, so that it reaches every panel, frame and plot alike. Letters stay:
those of a name, and Hangul.
"""

from __future__ import annotations

from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

from console.escaping import LIKE

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the dots of a braille character, by row and column."""


def _of_dots(bits: int) -> str:
    """Return the sign that is most like a cell of dots: where its dots are, and how they run."""
    rows = [bool(bits & (left | right)) for left, right in _DOTS]
    left, right = (sum(bool(bits & row[side]) for row in _DOTS) for side in (0, 1))
    if left + right >= 6:
        return "#"
    if sum(rows) >= 3:
        return _of_upright_dots(bits) if left and right else "|"
    if rows[0] or (rows[1] and not rows[2] and not rows[3]):
        return "'" if left + right == 1 or sum(rows) > 1 else '"'
    if left and right:
        return "-" if rows[1] or (rows[2] and not rows[3]) else "_"
    return "."


def _of_upright_dots(bits: int) -> str:
    left, right = (next((n for n, row in enumerate(_DOTS) if bits & row[side]), 9) for side in (0, 1))
    return "|" if abs(left - right) <= 1 else "/" if right < left else "\\"


TABLE = {
    **dict.fromkeys(range(0x2500, 0x2580), "+"),  # lines and their crossings; blocks after them
    **dict.fromkeys(range(0x2580, 0x25A0), "#"),
    **{ord(shade): plain for shade, plain in zip("░▒▓", "+%#", strict=True)},
    ord("▴"): "^",
    ord("═"): "=",
    ord("║"): "|",
    **LIKE,
    **{0x2800 + bits: _of_dots(bits) for bits in range(1, 256)},
    **dict.fromkeys(map(ord, "↑▲△"), "^"),
    **dict.fromkeys(map(ord, "↓▼▽"), "v"),
    ord("⌫"): "<",
    ord("…"): "~",  # "." would look like the end of a sentence
    ord("▏"): "_",
    ord("±"): "~",
    ord("≠"): "#",
    ord("≡"): "=",
    ord("∞"): "*",
    ord("‖"): "|",
    ord("•"): "*",
    ord("∙"): ".",
    **{ord(raised): plain for raised, plain in zip("⁰¹²³", "0123", strict=True)},
    ord("≤"): "<",
    ord("≥"): ">",
}


_PAIRS = {"± ": "+-", "≤ ": "<=", "≥ ": ">=", "≠ ": "!="}
"""Signs that need two cells, and have them where a blank follows."""


def in_ascii(text: str) -> str:
    """Return a text in ASCII but for its letters, in as many cells."""
    if text.isascii():
        return text
    for sign, written in _PAIRS.items():
        text = text.replace(sign, written)
    return text.translate(TABLE)


class AsciiGlyphs(LineFilter):
    """Replaces the signs of each line on its way to the terminal."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """Return the segments in ASCII, each in as many cells as before."""
        return [
            each if each.control or each.text.isascii() else Segment(in_ascii(each.text), each.style)
            for each in segments
        ]
