"""Traces lie over their axes, and only what changed is sent to the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import pytest
from textual.app import App, ComposeResult
from textual.containers import Horizontal
from textual.geometry import Region

from console.tui.plot.cell_view import Cells
from console.tui.plot.polar_view import Mark, PolarTrace, PolarView
from console.tui.plot.trace_view import Series, TracePicture, TraceView, trace_cells
from console.tui.theme import COLOUR, MONO, Palette, Token

TURN = (0.0, 360.0)
ANGLE_DEG = np.arange(361.0)


def harmonic(shift_deg: float = 0.0, token: Token = Token.AFTER, dashed: bool = False) -> Series:
    return Series(
        x=ANGLE_DEG, y=100.0 + 25.0 * np.cos(np.radians(3.0 * ANGLE_DEG + shift_deg)), token=token, dashed=dashed
    )


def picture(*series: Series) -> TracePicture:
    return TracePicture(series=series, x_limits=TURN, y_limits=(70.0, 130.0), y_unit="um", x_unit="°")


class Recorded(TraceView):
    """Remembers what it asked Textual to draw again."""

    def __init__(self, palette: Palette = COLOUR) -> None:
        super().__init__(palette=palette)
        self.asked: list[Region] = []

    def refresh(self, *regions: Region, **options: Any) -> Self:
        self.asked.extend(regions)
        return super().refresh(*regions, **options)


class Page(App[None]):
    def __init__(self, palette: Palette = COLOUR) -> None:
        super().__init__()
        self.trace, self.polar = Recorded(palette), PolarView(palette=palette)

    def compose(self) -> ComposeResult:
        with Horizontal():
            yield self.trace
            yield self.polar

    def show(self, series: Sequence[Series]) -> None:
        self.trace.show(picture(*series))
        traces = [
            PolarTrace(angle_deg=each.x, deviation_um=np.asarray(each.y) - 100.0, token=each.token)
            for each in series
        ]
        self.polar.show(traces, marks=[Mark(angle_deg=0.0, label="1")])


def lines(view: TraceView | PolarView) -> list[str]:
    return [view.render_line(y).text for y in range(view.size.height)]


def dot_count(cells: Cells) -> int:
    codes = cells.codes[(cells.codes > 0x2800) & (cells.codes < 0x2900)]
    return sum((int(code) - 0x2800).bit_count() for code in codes)


def test_a_flat_trace_lies_beside_its_tick() -> None:
    rows = trace_cells(picture(Series(x=ANGLE_DEG, y=np.full(361, 80.0), token=Token.AFTER)), 42, 10).text_rows()
    drawn = [row for row in rows if any(0x2800 < ord(character) < 0x2900 for character in row)]
    assert len(drawn) == 1 and drawn[0].startswith(" 80┤")
    assert len(drawn[0]) == 42 and " " not in drawn[0][4:]


def test_without_data_there_are_no_axes_whose_numbers_would_mean_nothing() -> None:
    assert "".join(trace_cells(TracePicture(y_unit="um"), 60, 20).text_rows()).split() == []


def test_three_lobes_are_seen() -> None:
    rows = trace_cells(picture(harmonic()), 64, 12).text_rows()
    top = next(row for row in rows if any(ord(character) > 0x2800 for character in row[4:]))
    assert len("".join(c if ord(c) > 0x2800 else " " for c in top[4:]).split()) == 4  # one is cut in two at 0


def test_the_later_trace_has_the_colour_and_neither_has_gaps() -> None:
    both = trace_cells(picture(harmonic(0.0, Token.BEFORE), harmonic(40.0, Token.AFTER)), 64, 12)
    alone = trace_cells(picture(harmonic(40.0, Token.AFTER)), 64, 12)
    mine = alone.tokens == Token.AFTER.value
    assert (both.tokens[mine] == Token.AFTER.value).all()
    dots = alone.codes[mine] - 0x2800
    assert ((both.codes[mine] - 0x2800) & dots == dots).all()
    assert Token.BEFORE.value in both.tokens


def test_a_dashed_trace_differs_without_colour() -> None:
    solid, dashed = (dot_count(trace_cells(picture(harmonic(dashed=dashed)), 64, 12)) for dashed in (False, True))
    assert 0.2 * solid < dashed < 0.5 * solid


def test_single_points_are_not_joined() -> None:
    sparse = Series(x=[30.0, 90.0, 300.0], y=[80.0, 120.0, 90.0], token=Token.AFTER, dots=True)
    assert dot_count(trace_cells(picture(sparse), 64, 12)) == 3


@pytest.mark.parametrize("size", [(1, 1), (2, 5), (5, 2), (9, 4), (160, 48)])
def test_every_size_is_filled(size: tuple[int, int]) -> None:
    broken = Series(x=[0.0, 10.0, 20.0, 1e12], y=[math.nan, 100.0, math.inf, -1e12], token=Token.WANTED, dots=True)
    rows = trace_cells(picture(harmonic(), broken), *size).text_rows()
    assert [len(row) for row in rows] == [size[0]] * size[1]


async def test_only_changed_spans_are_drawn_again() -> None:
    app = Page()
    async with app.run_test(size=(100, 20)) as pilot:
        app.show([harmonic()])
        await pilot.pause()
        before = lines(app.trace)
        app.trace.asked.clear()
        app.show([harmonic()])
        assert app.trace.asked == []
        bent = np.array(harmonic().y)
        bent[170:180] += 10.0
        app.show([Series(x=ANGLE_DEG, y=bent, token=Token.AFTER)])
        after = lines(app.trace)
        await pilot.pause()
        changed = {(x, y) for y in range(len(after)) for x in range(len(after[y])) if after[y][x] != before[y][x]}
        asked = {(x, y) for region in app.trace.asked for x in region.column_range for y in region.line_range}
        assert changed and changed <= asked
        assert len(asked) < 0.2 * 50 * 20
        assert max(x for x, _ in asked) < 40


async def test_the_last_data_fill_every_new_size() -> None:
    app = Page()
    async with app.run_test(size=(80, 24)) as pilot:
        app.show([harmonic()])
        for size in ((80, 24), (20, 3), (2, 1), (161, 49), (1, 1), (7, 30), (80, 24)):
            await pilot.resize_terminal(*size)
            app.show([harmonic(5.0)])
            app.show([harmonic()])
            await pilot.pause()
            for view in (app.trace, app.polar):
                assert all(len(row) == view.size.width for row in lines(view))
        assert lines(app.trace) == trace_cells(picture(harmonic()), 40, 24).text_rows()


@pytest.mark.parametrize("palette", [COLOUR, MONO], ids=["colour", "mono"])
async def test_plots_survive_a_terminal_without_colour(monkeypatch: pytest.MonkeyPatch, palette: Palette) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    app = Page(palette)
    async with app.run_test(size=(80, 24)) as pilot:
        for shift_deg in (0.0, 10.0, 20.0):
            app.show([harmonic(shift_deg)])
            await pilot.pause()
        assert any("um" in row for row in lines(app.trace))


def test_plots_take_no_focus_and_keep_their_own_copy() -> None:
    view, values = TraceView(), np.zeros(3)
    series = Series(x=np.arange(3.0), y=values, token=Token.AFTER)
    view.show(TracePicture(series=[series], x_limits=(0.0, 2.0), y_limits=(-1.0, 1.0), y_unit="um"))
    first = view.draw(30, 8).text_rows()
    values += 0.8
    assert view.draw(30, 8).text_rows() == first
    assert not view.can_focus and not PolarView().can_focus
