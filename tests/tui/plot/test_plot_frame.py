"""Axes fit the size to the cell, name their ticks, and data land where the ticks say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.tui.plot.frame import PlotFrame, plot_frame

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
