"""Roundness is drawn round, on one scale, with the jaw where it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.tui.plot.cell_view import Cells
from console.tui.plot.polar_view import (
    DIVISIONS,
    Mark,
    PolarTrace,
    PolarView,
    dial,
    fitting_um_per_division,
    polar_cells,
)
from console.tui.theme import Token

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
    cells = polar_cells([lobed(2.0)], [Mark(angle_deg=0.0, label="jaw 1")], 1.0, columns, rows)
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
    rows = polar_cells([], [Mark(angle_deg=angle_deg, label="1")], 1.0, 60, 20).text_rows()
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
