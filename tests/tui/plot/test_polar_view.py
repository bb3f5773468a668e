"""Roundness is drawn round, on one scale, with the jaw where it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.app import App, ComposeResult
from textual.containers import Horizontal
from textual.geometry import Region

from console.tui.plot.cell_view import Cells
from console.tui.plot.polar_view import (
    DIVISIONS,
    AngleMark,
    PolarTrace,
    PolarView,
    dial,
    fitting_um_per_division,
    polar_cells,
)
from console.tui.plot.trace_view import Series, TracePicture, TraceView, trace_cells
from console.tui.theme import COLOUR, MONO, Palette, Token

ANGLE_DEG = np.arange(360.0)
SIZES = [(33, 8), (50, 10), (80, 24), (40, 20), (160, 48), (12, 40), (7, 3)]


def lobed(amplitude_um: float, token: Token = Token.AFTER, lobes: int = 3, dashed: bool = False) -> PolarTrace:
    deviation_um = amplitude_um * np.cos(np.radians(lobes * ANGLE_DEG))
    return PolarTrace(angle_deg=ANGLE_DEG, deviation_um=deviation_um, token=token, dashed=dashed)


def trace_dots(cells: Cells, token: Token) -> np.ndarray:
    """The x, y of the dots in the cells of a token, decoded from the braille characters."""
    place = {1: (0, 0), 2: (0, 1), 4: (0, 2), 8: (1, 0), 16: (1, 1), 32: (1, 2), 64: (0, 3), 128: (1, 3)}
    dots = [
        (2 * column + across, 4 * row + down)
        for row, column in np.argwhere((cells.tokens == token.value) & (cells.codes > 0x2800))
        for bit, (across, down) in place.items()
        if (int(cells.codes[row, column]) - 0x2800) & bit
    ]
    return np.array(dots, dtype=float).reshape(-1, 2)


def polar(cells: Cells, token: Token) -> tuple[np.ndarray, np.ndarray]:
    """Radius, dots, and angle, deg, of the dots of a token about the middle of the picture."""
    x, y = trace_dots(cells, token).T
    right, up = x - (2 * cells.columns - 1) / 2.0, (4 * cells.rows - 1) / 2.0 - y
    return np.hypot(right, up), np.degrees(np.arctan2(up, right)) % 360.0


@pytest.mark.parametrize(("columns", "rows"), SIZES)
def test_a_round_part_is_round(columns: int, rows: int) -> None:
    cells = polar_cells([lobed(0.0)], [], 1.0, columns, rows)
    place = dial(columns, rows)
    radius, angle_deg = polar(cells, Token.AFTER)
    x, y = trace_dots(cells, Token.AFTER).T
    # Dots of the other rings and of the cross share cells with the part.
    away = np.abs(radius[:, None] - [place.reference - place.division, place.reference + place.division]).min(
        axis=1
    )
    foreign = ((away < 1.0) & (place.division >= 4.0)) | (radius < 3.0) & (place.reference > 4.0)
    radius, angle_deg, x, y = radius[~foreign], angle_deg[~foreign], x[~foreign], y[~foreign]
    assert np.ptp(radius) < 1.0
    assert radius.mean() == pytest.approx(place.reference, abs=0.5)
    assert abs(np.ptp(x) - np.ptp(y)) <= 1.0
    if min(2 * columns, 4 * rows) > 20:
        assert np.diff(np.sort(angle_deg)).max() < 15.0


@given(st.integers(1, 120), st.integers(1, 50))
def test_it_fits_every_size(columns: int, rows: int) -> None:
    cells = polar_cells([lobed(2.0)], [AngleMark(angle_deg=0.0, label="jaw 1")], 1.0, columns, rows)
    assert (cells.columns, cells.rows) == (columns, rows)
    place = dial(columns, rows)
    assert place.rim <= max(min(2 * columns, 4 * rows) / 2.0, 0.5)


def test_lobes_stand_where_they_are() -> None:
    cells = polar_cells([lobed(2.0)], [], 1.0, 80, 24)
    place = dial(80, 24)
    radius, angle_deg = polar(cells, Token.AFTER)
    expected = place.reference + 2.0 * place.division * np.cos(np.radians(3.0 * angle_deg))
    assert np.abs(radius - expected)[radius > 0.9 * place.rim].size > 0
    assert np.median(np.abs(radius - expected)) < 1.0


def test_angles_run_counter_clockwise() -> None:
    quarter = PolarTrace(angle_deg=np.arange(80.0, 100.0), deviation_um=np.zeros(20), token=Token.AFTER)
    _, angle_deg = polar(polar_cells([quarter], [], 1.0, 60, 24), Token.AFTER)
    assert np.median(angle_deg) == pytest.approx(90.0, abs=6.0)
    assert trace_dots(polar_cells([quarter], [], 1.0, 60, 24), Token.AFTER)[:, 1].max() < 4 * 24 / 2


def test_all_traces_share_the_scale_and_the_largest_fits() -> None:
    before, after = lobed(27.5, Token.BEFORE), lobed(1.3)
    assert fitting_um_per_division([before, after]) == pytest.approx(20.0)
    cells = polar_cells([before, after], [], 20.0, 80, 24)
    place = dial(80, 24)
    assert polar(cells, Token.BEFORE)[0].max() <= place.rim + 1.0
    assert polar(cells, Token.BEFORE)[0].max() == pytest.approx(
        place.reference + 27.5 / 20.0 * place.division, abs=1.0
    )
    smooth = polar(cells, Token.AFTER)[0]
    assert np.median(np.abs(smooth - place.reference)) < 1.0


@given(st.floats(1e-3, 1e4))
def test_the_scale_is_enough_and_not_too_coarse(largest_um: float) -> None:
    scale = fitting_um_per_division([lobed(largest_um)])
    assert largest_um <= DIVISIONS * scale * (1.0 + 1e-6)
    assert scale <= max(2.5 * largest_um / DIVISIONS, 0.1) * (1.0 + 1e-6)


def test_before_and_after_differ_without_colour() -> None:
    solid = polar_cells([lobed(0.0)], [], 1.0, 80, 24)
    dashed = polar_cells([lobed(0.0, dashed=True)], [], 1.0, 80, 24)
    ring = np.abs(polar(solid, Token.AFTER)[0] - dial(80, 24).reference) < 1.0
    dots = polar(dashed, Token.AFTER)
    assert dots[0].size < 0.8 * ring.sum()
    assert np.diff(np.sort(dots[1])).max() > 2.0 * np.median(np.diff(np.sort(polar(solid, Token.AFTER)[1])))


def test_a_missing_stretch_stays_open() -> None:
    deviation_um = np.where((ANGLE_DEG > 30.0) & (ANGLE_DEG < 150.0), math.nan, 0.0)
    cells = polar_cells(
        [PolarTrace(angle_deg=ANGLE_DEG, deviation_um=deviation_um, token=Token.AFTER)], [], 1.0, 80, 24
    )
    _, angle_deg = polar(cells, Token.AFTER)
    assert not ((angle_deg > 40.0) & (angle_deg < 140.0)).any()


@pytest.mark.parametrize(
    ("angle_deg", "right", "up"),
    [(0.0, True, None), (90.0, None, True), (180.0, False, None), (270.0, None, False)],
)
def test_the_jaw_is_marked_at_its_angle(angle_deg: float, right: bool | None, up: bool | None) -> None:
    rows = polar_cells([], [AngleMark(angle_deg=angle_deg, label="1")], 1.0, 60, 20).text_rows()
    [(row, column)] = [(row, text.index("1")) for row, text in enumerate(rows) if "1" in text]
    half_width = dial(60, 20).rim / 2.0
    if right is None:
        assert column == pytest.approx(30, abs=1)
        assert row == (0 if up else 19)
    else:
        assert row == pytest.approx(9.5, abs=1)
        assert (column - 30 if right else 30 - column) == pytest.approx(half_width, abs=3)


def test_there_are_rings_and_a_centre() -> None:
    cells = polar_cells([], [], 1.0, 80, 24)
    place = dial(80, 24)
    radius, _ = polar(cells, Token.RING)
    rings = (place.reference - place.division, place.reference, place.reference + place.division)
    assert all((np.abs(radius - ring) < 1.0).sum() > 10 for ring in rings)
    assert radius.min() < 1.0
    assert all(min(abs(each - ring) for ring in (*rings, 1.0)) < 2.0 for each in radius)


def test_the_view_names_its_scale() -> None:
    view = PolarView()
    view.show([lobed(27.5)])
    assert view.scale_um_per_division == pytest.approx(20.0)
    view.show([lobed(27.5)], um_per_division=50.0)
    assert view.scale_um_per_division == 50.0
    view.show([])
    assert view.scale_um_per_division > 0.0
    view.show([PolarTrace(angle_deg=[0.0, 1.0], deviation_um=[math.nan, math.nan], token=Token.AFTER)])
    assert view.scale_um_per_division > 0.0


# Traces lie over their axes, and only what changed is sent to the terminal.


TURN = (0.0, 360.0)
TRACE_ANGLE_DEG = np.arange(361.0)


def harmonic(shift_deg: float = 0.0, token: Token = Token.AFTER, dashed: bool = False) -> Series:
    return Series(
        x=TRACE_ANGLE_DEG,
        y=100.0 + 25.0 * np.cos(np.radians(3.0 * TRACE_ANGLE_DEG + shift_deg)),
        token=token,
        dashed=dashed,
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
        self.polar.show(traces, marks=[AngleMark(angle_deg=0.0, label="1")])


def lines(view: TraceView | PolarView) -> list[str]:
    return [view.render_line(y).text for y in range(view.size.height)]


def dot_count(cells: Cells) -> int:
    codes = cells.codes[(cells.codes > 0x2800) & (cells.codes < 0x2900)]
    return sum((int(code) - 0x2800).bit_count() for code in codes)


def test_a_flat_trace_lies_beside_its_tick() -> None:
    rows = trace_cells(
        picture(Series(x=TRACE_ANGLE_DEG, y=np.full(361, 80.0), token=Token.AFTER)), 42, 10
    ).text_rows()
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
        app.show([Series(x=TRACE_ANGLE_DEG, y=bent, token=Token.AFTER)])
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
