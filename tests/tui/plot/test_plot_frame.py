"""Axes fit the size to the cell, name their ticks, and data land where the ticks say."""

from __future__ import annotations

import math
import textwrap
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rich.style import Style
from textual.geometry import Region

from console.tui.lines import plain_text, width_of
from console.tui.plot.big_number import big_number
from console.tui.plot.canvas import NO_LAYER, BrailleCanvas, Dash
from console.tui.plot.cell_view import Brush, Cells, changed_spans
from console.tui.plot.frame import (
    PlotFrame,
    coarser,
    label,
    nice_limits,
    plot_frame,
    proper_limits,
    step_125,
    ticks,
)
from console.tui.theme import COLOUR, MONO, Palette, Token

TURN = (0.0, 360.0)


def stroke(columns: int = 42, rows: int = 10) -> PlotFrame:
    return plot_frame(columns, rows, TURN, (70.0, 130.0), "um", "°")


def test_axes_of_a_tool_stroke() -> None:
    assert [row.rstrip() for row in stroke(30, 8).rows] == [
        "   │",
        "120┤",
        "100┤",
        " um│",
        " 80┤",
        "   │",
        "   └┬───────┬────────┬───────┬",
        "    0      120      240  360°",
    ]


@given(st.integers(-1, 130), st.integers(-1, 50), st.sampled_from([(70.0, 130.0), (-1e5, 1e5), (0.0, 0.0)]))
def test_rows_fill_every_size_exactly(columns: int, rows: int, y_limits: tuple[float, float]) -> None:
    frame = plot_frame(columns, rows, TURN, y_limits, "um", "°")
    assert [len(row) for row in frame.rows] == [max(columns, 1)] * max(rows, 1)
    assert frame.data_columns >= 1 and frame.data_rows >= 1
    assert frame.left + frame.data_columns == max(columns, 1)
    assert frame.data_rows <= max(rows, 1)
    assert {row[frame.left :].strip() for row in frame.rows[: frame.data_rows]} == {""}


def test_limits_are_the_outermost_dots() -> None:
    frame = stroke()
    x, y = frame.to_dots([0.0, 360.0], [70.0, 130.0])
    assert x.tolist() == pytest.approx([0.0, 2 * frame.data_columns - 1])
    assert y.tolist() == pytest.approx([4 * frame.data_rows - 1, 0.0])


def test_data_lie_beside_their_tick() -> None:
    frame = stroke()
    rows = [row for row in range(frame.data_rows) if frame.rows[row][: frame.left - 1].strip().isdigit()]
    values = [float(frame.rows[row][: frame.left - 1]) for row in rows]
    _, y = frame.to_dots(np.zeros(len(values)), values)
    assert np.abs(y / 4.0 - (np.array(rows) + 0.5)).max() <= 1.0
    columns = [column for column, mark in enumerate(frame.rows[frame.data_rows]) if mark == "┬"]
    x, _ = frame.to_dots([0.0, 120.0, 240.0, 360.0], np.zeros(4))
    assert np.abs(x / 2.0 + frame.left - (np.array(columns) + 0.5)).max() <= 1.0


def test_other_axes_have_round_ticks() -> None:
    labels = plot_frame(60, 10, (0.0, 0.5), (0.0, 8.0), "A", " s").rows[-1].split()
    assert labels == ["0", "0.2", "0.4", "s"]


def test_too_little_room_is_left_to_the_data() -> None:
    frame = plot_frame(6, 3, TURN, (70.0, 130.0), "um")
    assert (frame.left, frame.data_columns, frame.data_rows) == (0, 6, 3)


def test_strange_limits_do_no_harm() -> None:
    frame = plot_frame(40, 10, (math.nan, math.inf), (5.0, 5.0))
    x, y = frame.to_dots([0.0, 1.0], [5.0, math.nan])
    assert np.isfinite(x).all() and np.isfinite(y[0])
    assert any("┤" in row for row in frame.rows)


def test_the_same_axes_are_drawn_once() -> None:
    assert stroke() is stroke()


# Large numbers: as drawn by hand, and in plain text where there is no room.


DRAWN = """\
        ██  ██  ██████      ██████
        ██  ██  ██  ██          ██
██████  ██████  ██  ██          ██
            ██  ██  ██          ██
            ██  ██████  ██      ██ mm
"""


def test_a_number_is_drawn_with_its_label_and_its_unit() -> None:
    drawn = plain_text(big_number("-40.7", "speed", "mm", 60))
    assert textwrap.dedent(drawn.replace("speed", "     ")) + "\n" == DRAWN
    assert drawn.splitlines()[2].startswith("speed ")


def test_a_number_without_room_or_form_is_plain_text() -> None:
    for number, width in (("1234.5678", 30), ("∞", 60)):
        (row,) = big_number(number, "spindle", "rpm", width)
        assert number in plain_text([row])
        assert width_of(row) == width


# Axes carry round numbers.


spans = st.tuples(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6)).map(lambda pair: (pair[0], pair[0] + pair[1]))


def is_round(step: float) -> bool:
    mantissa = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    return any(math.isclose(mantissa, each, rel_tol=1e-6) for each in (1.0, 2.0, 5.0))


@pytest.mark.parametrize(
    ("at_least", "step"), [(13.75, 20.0), (20.0, 20.0), (1.0, 1.0), (0.11, 0.2), (5.1, 10.0), (3e-4, 5e-4)]
)
def test_a_step_is_the_next_round_number(at_least: float, step: float) -> None:
    assert step_125(at_least) == pytest.approx(step)


@given(st.floats(1e-9, 1e9))
def test_a_step_reaches_and_is_not_wasteful(at_least: float) -> None:
    step = step_125(at_least)
    assert is_round(step)
    assert at_least * (1.0 - 1e-6) <= step <= 2.5 * at_least * (1.0 + 1e-6)


def test_a_coarser_step_is_the_next_round_one() -> None:
    steps = [0.1]
    while steps[-1] < 99.0:
        steps.append(coarser(steps[-1]))
    assert steps == pytest.approx([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])


@given(spans, st.integers(2, 12))
def test_ticks_are_few_and_inside(limits: tuple[float, float], most: int) -> None:
    low, high = limits
    found = ticks(limits, most)
    assert 2 <= len(found) <= most
    slack = 1e-6 * (high - low)
    assert all(low - slack <= tick <= high + slack for tick in found)
    assert list(found) == sorted(found)


def test_ticks_of_a_tool_stroke() -> None:
    assert ticks((70.0, 130.0), 4) == (80.0, 100.0, 120.0)
    assert ticks((-3.3, 2.7), 2) == (-2.0, 2.0)


def test_limits_hold_still_while_data_wander() -> None:
    assert nice_limits(-1.82, 1.97) == nice_limits(-1.71, 1.93) == (-2.0, 2.0)
    assert nice_limits(72.5, 127.5) == (60.0, 140.0)


@given(st.floats(allow_nan=True, allow_infinity=True), st.floats(-1e3, 1e3))
def test_limits_always_leave_room(low: float, high: float) -> None:
    for limits in (proper_limits((low, high)), proper_limits((high, high))):
        assert limits[0] < limits[1]
        assert all(map(math.isfinite, limits))


@pytest.mark.parametrize(("value", "text"), [(-0.0, "0"), (0.1 + 0.2, "0.3"), (100000.0, "100000"), (-2.0, "-2")])
def test_labels_are_short(value: float, text: str) -> None:
    assert label(value) == text


# What changed between two pictures is found, and strips are safe for Textual.


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
    assert changed_spans(Cells.blank(COLUMNS, ROWS), new) == [Region(1, 0, 8, 1), Region(5, 2, 1, 1)]


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


# The canvas sets the dots that were asked for, joins them without gaps and merges its layers.


BRAILLE_COLUMNS, BRAILLE_ROWS = 11, 6
WIDTH, HEIGHT = 2 * BRAILLE_COLUMNS, 4 * BRAILLE_ROWS

Point = tuple[float, float]
inside = st.tuples(st.floats(0.0, WIDTH - 1.0), st.floats(0.0, HEIGHT - 1.0))
anywhere = st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 2)
nearby = st.tuples(st.floats(-30.0, 50.0), st.floats(-30.0, 50.0))


def nearest(point: Point) -> Point:
    return math.floor(point[0] + 0.5), math.floor(point[1] + 0.5)


def dots_of(canvas: BrailleCanvas) -> set[Point]:
    return {(float(x), float(y)) for y, x in np.argwhere(canvas._dots)}


def text_rows(canvas: BrailleCanvas) -> list[str]:
    return ["".join(map(chr, row)) for row in canvas.cell_codes().tolist()]


def line(points: list[Point], dash: Dash | None = None) -> BrailleCanvas:
    canvas = BrailleCanvas(BRAILLE_COLUMNS, BRAILLE_ROWS)
    canvas.polyline([x for x, _ in points], [y for _, y in points], 0, dash)
    return canvas


def reachable(dots: set[Point], start: Point) -> set[Point]:
    found, ahead = {start}, [start]
    while ahead:
        x, y = ahead.pop()
        touching = {(x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)} & dots - found
        found |= touching
        ahead.extend(touching)
    return found


def distance(dot: Point, a: Point, b: Point) -> float:
    """From a dot to the straight line between two points."""
    along = (b[0] - a[0], b[1] - a[1])
    length2 = along[0] ** 2 + along[1] ** 2
    share = 0.0 if length2 == 0.0 else ((dot[0] - a[0]) * along[0] + (dot[1] - a[1]) * along[1]) / length2
    share = min(max(share, 0.0), 1.0)
    return math.hypot(dot[0] - a[0] - share * along[0], dot[1] - a[1] - share * along[1])


@given(st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1))
def test_a_dot_lands_in_its_cell(x: int, y: int) -> None:
    canvas = BrailleCanvas(BRAILLE_COLUMNS, BRAILLE_ROWS)
    canvas.points([x], [y], 3)
    rows = text_rows(canvas)
    assert [len(row) for row in rows] == [BRAILLE_COLUMNS] * BRAILLE_ROWS
    written = {(row, column): glyph for row, text in enumerate(rows) for column, glyph in enumerate(text)}
    assert [cell for cell, glyph in written.items() if glyph != " "] == [(y // 4, x // 2)]
    # The braille block numbers the dots 1 to 6 down its two columns and 7, 8 in the row below them.
    number = {(0, 0): 1, (0, 1): 2, (0, 2): 3, (1, 0): 4, (1, 1): 5, (1, 2): 6, (0, 3): 7, (1, 3): 8}[x % 2, y % 4]
    assert ord(written[y // 4, x // 2]) == 0x2800 + 2 ** (number - 1)
    assert canvas.cell_layers()[y // 4, x // 2] == 3


@given(inside, inside)
def test_a_line_sets_both_ends_and_has_no_gap(a: Point, b: Point) -> None:
    dots = dots_of(line([a, b]))
    assert {nearest(a), nearest(b)} <= dots
    assert reachable(dots, nearest(a)) == dots


@given(st.lists(inside, min_size=2, max_size=8))
@example([(0.0, 0.0), (0.6, 0.4), (1.0, 1.5)])
def test_a_path_has_no_gap_and_keeps_to_its_points(points: list[Point]) -> None:
    dots = dots_of(line(points))
    assert reachable(dots, nearest(points[0])) == dots
    legs = list(pairwise(points))
    assert max(min(distance(dot, a, b) for a, b in legs) for dot in dots) <= math.sqrt(0.5) + 1e-6


@given(nearby, nearby)
def test_a_line_that_leaves_the_canvas_is_cut_and_not_bent(a: Point, b: Point) -> None:
    assert all(distance(dot, a, b) <= math.sqrt(0.5) + 1e-6 for dot in dots_of(line([a, b])))


@given(st.lists(anywhere, max_size=6))
def test_no_point_is_too_strange(points: list[Point]) -> None:
    canvas = line(points)
    canvas.points([x for x, _ in points], [y for _, y in points], 1)
    assert [len(row) for row in text_rows(canvas)] == [BRAILLE_COLUMNS] * BRAILLE_ROWS


@given(st.lists(inside, max_size=5), st.lists(inside, max_size=5))
def test_layers_are_merged_and_the_higher_one_gives_the_colour(low: list[Point], high: list[Point]) -> None:
    both = line(low)
    both.polyline([x for x, _ in high], [y for _, y in high], 1)
    alone = line(high)
    assert dots_of(both) == dots_of(line(low)) | dots_of(alone)
    on_top = alone.cell_layers() != NO_LAYER
    assert (both.cell_layers()[on_top] == 1).all()
    assert (both.cell_layers()[~on_top] == line(low).cell_layers()[~on_top]).all()
    assert ((both.cell_layers() == NO_LAYER) == (both.cell_codes() == ord(" "))).all()


def test_the_order_of_drawing_does_not_matter() -> None:
    canvas = BrailleCanvas(2, 1)
    canvas.points([0.0], [0.0], 5)
    canvas.points([0.0], [1.0], 2)
    assert canvas.cell_layers().tolist() == [[5, NO_LAYER]]


def test_a_missing_value_breaks_the_line_and_a_lone_point_is_seen() -> None:
    nan = math.nan
    dots = dots_of(line([(0, 0), (3, 0), (nan, 0), (8, 0), (12, nan), (15, 0), (18, 0)]))
    assert dots == {(0, 0), (1, 0), (2, 0), (3, 0), (8, 0), (15, 0), (16, 0), (17, 0), (18, 0)}


def test_a_dashed_line_has_gaps() -> None:
    dots = dots_of(line([(0, 5), (WIDTH - 1, 5)], Dash(on=2, off=3)))
    assert sorted(x for x, _ in dots) == [x for x in range(WIDTH) if x % 5 < 2]


def test_a_fresh_canvas_is_blank() -> None:
    canvas = line([])
    assert text_rows(canvas) == [" " * BRAILLE_COLUMNS] * BRAILLE_ROWS
    assert (canvas.cell_layers() == NO_LAYER).all()


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (-3, 2)])
def test_a_canvas_has_at_least_one_cell(size: tuple[int, int]) -> None:
    canvas = BrailleCanvas(*size)
    canvas.polyline([0, 1], [0, 3], 0)
    assert text_rows(canvas)[0] != " "
