"""What changed between two pictures is found, and strips are safe for Textual."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.style import Style
from textual.geometry import Region

from console.tui.plot.canvas import BrailleCanvas
from console.tui.plot.cell_view import Brush, Cells, changed_spans
from console.tui.theme import COLOUR, MONO, Palette, Token

COLUMNS, ROWS = 12, 4
writings = st.lists(
    st.tuples(
        st.integers(-1, ROWS),
        st.integers(-3, COLUMNS),
        st.text("ab ⠿°한", max_size=5),
        st.sampled_from([Token.AXIS, Token.AFTER, Token.STALE, Token.ALARM]),
    ),
    max_size=4,
)
Writing = tuple[int, int, str, Token]


def picture(written: list[Writing]) -> Cells:
    cells = Cells.blank(COLUMNS, ROWS)
    for row, column, text, token in written:
        cells.write(row, column, text, token)
    return cells


def as_seen(cells: Cells, row: int, palette: Palette) -> list[tuple[str, Style | None]]:
    """What the terminal shows; the foreground of a plain blank cannot be seen."""
    seen: list[tuple[str, Style | None]] = []
    background = palette[Token.TEXT].bgcolor
    for segment in Brush(palette).strip(cells, row):
        style = segment.style
        assert isinstance(style, Style)
        plain = style.bgcolor == background and not (style.strike or style.reverse or style.underline)
        seen.extend((character, None if plain and character == " " else style) for character in segment.text)
    return seen


@given(writings, writings)
def test_drawing_only_the_spans_gives_the_new_picture(first: list[Writing], second: list[Writing]) -> None:
    old, new = picture(first), picture(second)
    screen = {row: as_seen(old, row, COLOUR) for row in range(ROWS)}
    for span in changed_spans(old, new):
        screen[span.y][span.x : span.right] = as_seen(new, span.y, COLOUR)[span.x : span.right]
    assert screen == {row: as_seen(new, row, COLOUR) for row in range(ROWS)}


def test_nothing_changed_costs_nothing() -> None:
    written = [(1, 2, "abc", Token.AFTER)]
    assert changed_spans(picture(written), picture(written)) == []


def test_a_change_of_meaning_is_a_change() -> None:
    old, new = picture([(1, 2, "abc", Token.BEFORE)]), picture([(1, 2, "abc", Token.BEFORE)])
    new.tokens[1, 3] = Token.AFTER.value
    assert changed_spans(old, new) == [Region(3, 1, 1, 1)]


def test_each_row_has_one_span() -> None:
    new = picture([(0, 1, "a", Token.AXIS), (0, 8, "b", Token.AXIS), (2, 5, "c", Token.AXIS)])
    assert changed_spans(Cells.blank(COLUMNS, ROWS), new) == [
        Region(1, 0, 8, 1),
        Region(5, 2, 1, 1),
    ]


@pytest.mark.parametrize("palette", [COLOUR, MONO], ids=["colour", "mono"])
@given(written=writings)
def test_every_strip_has_styles_and_the_width(palette: Palette, written: list[Writing]) -> None:
    cells = picture(written)
    for row, text in enumerate(cells.text_rows()):
        strip = Brush(palette).strip(cells, row)
        assert strip.text == text
        assert sum(segment.cell_length for segment in strip) == strip.cell_length == COLUMNS
        assert all(segment.style is not None for segment in strip)
        for (character, style), token in zip(as_seen(cells, row, palette), cells.tokens[row], strict=True):
            if style is not None:
                assert style == palette[Token(int(token))], character


def test_blanks_between_dots_do_not_change_the_style() -> None:
    assert len(list(Brush(COLOUR).strip(picture([(0, 2, "a", Token.AFTER), (0, 7, "b", Token.AFTER)]), 0))) == 1


def test_a_wide_character_does_not_move_the_row() -> None:
    assert picture([(0, 0, "a한b", Token.AXIS)]).text_rows()[0].rstrip() == "a?b"


def test_dots_take_the_token_of_their_layer() -> None:
    canvas = BrailleCanvas(2, 1)
    canvas.points([0, 2], [0, 0], 0)
    canvas.points([2], [1], 1)
    cells = Cells.blank(4, 2)
    cells.lay(canvas, 1, 1, (Token.RING, Token.AFTER))
    assert cells.text_rows() == ["    ", " ⠁⠃ "]
    assert np.flatnonzero(cells.tokens[1] == Token.RING.value).tolist() == [1]
    assert np.flatnonzero(cells.tokens[1] == Token.AFTER.value).tolist() == [2]
