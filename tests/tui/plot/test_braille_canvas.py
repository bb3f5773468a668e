"""The canvas sets the dots that were asked for, joins them without gaps and merges its layers."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from console.tui.plot.canvas import NO_LAYER, BrailleCanvas, Dash

COLUMNS, ROWS = 11, 6
WIDTH, HEIGHT = 2 * COLUMNS, 4 * ROWS

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
    canvas = BrailleCanvas(COLUMNS, ROWS)
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
    canvas = BrailleCanvas(COLUMNS, ROWS)
    canvas.points([x], [y], 3)
    rows = text_rows(canvas)
    assert [len(row) for row in rows] == [COLUMNS] * ROWS
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
    assert [len(row) for row in text_rows(canvas)] == [COLUMNS] * ROWS


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
    assert text_rows(canvas) == [" " * COLUMNS] * ROWS
    assert (canvas.cell_layers() == NO_LAYER).all()


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (-3, 2)])
def test_a_canvas_has_at_least_one_cell(size: tuple[int, int]) -> None:
    canvas = BrailleCanvas(*size)
    canvas.polyline([0, 1], [0, 3], 0)
    assert text_rows(canvas)[0] != " "
