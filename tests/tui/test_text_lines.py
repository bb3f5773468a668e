"""Lines of text: what is set to a width has that width, in cells."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from console.tui.lines import (
    BLANK,
    Line,
    changed,
    clipped,
    fact,
    fitted,
    hanging,
    line,
    name_among,
    name_in,
    plain,
    ranged,
    to_strip,
    width_of,
    wrapped,
)
from console.tui.theme import COLOUR, Token

words = st.text(st.sampled_from("ab c가나Ø°±·─") | st.characters(categories=["L", "N"]), max_size=30)
tokens = st.sampled_from([Token.TEXT, Token.DIM, Token.ALARM])
lines_ = st.lists(st.tuples(words, tokens), max_size=5).map(tuple)


@given(words, st.integers(0, 40))
def test_a_fitted_text_has_its_width(text: str, width: int) -> None:
    assert cell_len(fitted(text, width)) == width


@given(words, st.integers(4, 40))
def test_a_text_that_is_cut_says_so(text: str, width: int) -> None:
    if cell_len(text) > width:
        assert "…" in fitted(text, width)


@given(words, st.integers(0, 40))
def test_a_long_name_keeps_its_beginning_and_its_end(text: str, width: int) -> None:
    short = name_in(text, width)
    assert cell_len(short) <= width
    if cell_len(text) <= width:
        assert short == text
    elif width >= 4:
        head, _, tail = short.partition("…")
        assert text.startswith(head) and text.endswith(tail)


def test_names_of_a_family_stay_apart() -> None:
    assert name_in("lee-2001-experiment-1", 16) != name_in("lee-2001-experiment-2", 16)


ALIKE = tuple(
    f"customer-4711-{size}bearing-ring-outer-{side}-side-op20-jaws-3-rev-{letter}"
    for size in ("", "very-long-")
    for side in ("left", "right")
    for letter in "ab"
)


def test_long_names_that_differ_anywhere_are_told_apart() -> None:
    for width in (28, 32, 46):
        shown = [name_among(name, ALIKE, width) for name in ALIKE]
        assert len(set(shown)) == len(ALIKE), (width, shown)
        assert all(cell_len(each) <= width for each in shown)


@given(words, st.lists(words, max_size=4).map(tuple), st.integers(1, 40))
def test_a_name_among_others_fits_and_is_itself_where_there_is_room(
    name: str, others: tuple[str, ...], width: int
) -> None:
    short = name_among(name, others, width)
    assert cell_len(short) <= width
    assert short == name or cell_len(name) > width


@given(lines_, words, st.integers(30, 90))
def test_left_and_right_fill_the_row(left: tuple[tuple[str, Token], ...], right: str, width: int) -> None:
    right = fitted(right, min(cell_len(right), width))
    assert width_of(ranged(left, line(right), width)) == width


@given(words, words, st.integers(20, 60))
def test_a_fact_fills_its_row_and_its_value_stands_right(label: str, value: str, width: int) -> None:
    pieces = fact(label, value, width, label_width=10)
    assert width_of(pieces) == width
    assert pieces[-1][0].endswith(value) or cell_len(value) > width - 10


@given(words, st.integers(2, 30))
def test_wrapping_loses_no_letter_and_no_row_is_too_wide(text: str, width: int) -> None:
    rows = wrapped(text, width)
    assert "".join("".join(t for t, _ in row) for row in rows).replace(" ", "") == "".join(text.split())
    assert all(width_of(row) <= width for row in rows)


@given(words, st.integers(12, 40), st.sampled_from([BLANK, line("(3)"), line("가나 w")]))
def test_a_text_behind_its_mark_loses_no_letter_and_what_stands_beside_it_ends_its_first_row(
    text: str, width: int, beside: Line
) -> None:
    rows = hanging((" ! ", Token.ALARM), text, width, beside=beside)
    assert all(width_of(row) <= width for row in rows)
    assert all(plain([row]).startswith("   ") for row in rows[1:])
    first = plain(rows[:1])
    assert first.startswith(" !") and first.endswith(plain([beside]))
    said = first.removesuffix(plain([beside])) + plain(rows[1:])
    assert "".join(said.split()) == "!" + "".join(text.split())


@given(st.lists(st.just(line("row")), max_size=9), st.integers(0, 9))
def test_rows_without_room_end_with_what_shows_them(rows: list[Line], height: int) -> None:
    shown = clipped(rows, height, "more")
    assert len(shown) == min(len(rows), height)
    assert (plain(shown[-1:]) == "more") is (len(rows) > height > 0)


@given(lines_, st.integers(1, 60))
def test_a_strip_is_as_wide_as_its_place_and_has_a_style_everywhere(
    pieces: tuple[tuple[str, Token], ...], width: int
) -> None:
    strip = to_strip(pieces, width, COLOUR)
    assert strip.cell_length == width
    assert all(segment.style is not None for segment in strip)


@given(lines_, lines_)
def test_outside_of_the_changed_cells_nothing_changes(
    before: tuple[tuple[str, Token], ...], after: tuple[tuple[str, Token], ...]
) -> None:
    first, end = changed(before, after)
    old, new = (to_strip(pieces, 200, COLOUR) for pieces in (before, after))
    assert old.crop(0, first).text == new.crop(0, first).text
    assert old.crop(end, 200).text == new.crop(end, 200).text
    if before == after:
        assert (first, end) == (0, 0)
