"""A map shows where over angle and Z a part is high or low, without colour, and never hides its worst place."""

from __future__ import annotations

import numpy as np
import pytest

from console.tui.application.glyphs import in_ascii
from console.tui.plot.polar_view import AngleMark
from console.tui.plot.surface_map import SurfaceMap, map_cells
from console.tui.theme import Token
from console.units import Units

ANGLE_DEG = np.arange(0.0, 360.0, 5.0)
Z_MM = np.array([22.0, 24.0, 26.0, 28.0, 30.0])
LEFT = 5  # cells of the labels of Z
COLUMNS, ROWS = LEFT + 36, 12


def rows_of(picture: SurfaceMap, columns: int = COLUMNS, rows: int = ROWS) -> list[str]:
    return map_cells(picture, columns, rows).text_rows()


def high_at_the_end(**others: object) -> SurfaceMap:
    """4 um high from 0 to 180 degrees at the free end and 4 low elsewhere; 0 at the jaws' side."""
    half = np.where(ANGLE_DEG < 180.0, 4.0, -4.0)
    deviation_um = (Z_MM - 22.0)[:, None] / 8.0 * half
    return SurfaceMap(z_mm=Z_MM, angle_deg=ANGLE_DEG, deviation_um=deviation_um, **others)  # type: ignore[arg-type]


def test_high_and_low_differ_without_colour_and_the_free_end_is_at_the_top() -> None:
    rows = rows_of(high_at_the_end())
    assert rows[0] == "30.0 " + 18 * "▒" + 18 * ":"
    assert rows[9] == "22.0 " + 36 * " "
    assert rows[11].rstrip() == "+/-  1 ░/.  2 ▒/:  3 ▓/=  2 um/div"
    plain = in_ascii(rows[0])
    assert len(set(plain[LEFT:])) == 2


def test_tokens_tell_high_from_low() -> None:
    tokens = map_cells(high_at_the_end(), COLUMNS, ROWS).tokens[0, LEFT:]
    assert list(tokens) == 18 * [Token.HIGH.value] + 18 * [Token.LOW.value]


def test_a_fault_narrower_than_a_cell_is_seen() -> None:
    angle_deg = np.arange(0.0, 360.0, 0.5)
    deviation_um = np.zeros((1, angle_deg.size))
    deviation_um[0, 333] = -3.0  # 166.5 degrees, in the column from 160 to 170
    rows = rows_of(SurfaceMap(z_mm=[10.0], angle_deg=angle_deg, deviation_um=deviation_um))
    assert rows[0] == "10.0 " + 16 * " " + "=" + 19 * " "


def test_the_marked_section_is_shown_even_where_rows_are_fewer_than_sections() -> None:
    z_mm = np.linspace(0.0, 60.0, 61)
    deviation_um = np.zeros((61, ANGLE_DEG.size))
    deviation_um[37] = 5.0
    rows = rows_of(SurfaceMap(z_mm=z_mm, angle_deg=ANGLE_DEG, deviation_um=deviation_um, worst=37), rows=6)
    assert "37.0▸" + 36 * "▓" in rows


@pytest.mark.parametrize("um_per_step", [1.0, 100.0])
def test_a_stated_scale_is_kept(um_per_step: float) -> None:
    rows = rows_of(high_at_the_end(um_per_step=um_per_step))
    assert rows[0][LEFT] == ("▓" if um_per_step == 1.0 else " ")
    assert f"  {um_per_step:g} um/div" in rows[-1]


def test_what_is_unknown_is_no_zero() -> None:
    rows = rows_of(SurfaceMap(z_mm=[1.0], angle_deg=ANGLE_DEG, deviation_um=np.full((1, 72), np.nan)))
    assert rows[0] == "1.0 " + 37 * "?"


def test_jaw_and_angles_stand_under_their_columns() -> None:
    rows = rows_of(high_at_the_end(marks=[AngleMark(angle_deg=60.0, label="1")]))
    assert rows[10].index("▴1") == LEFT + 6
    assert rows[10].split() == ["mm", "0", "▴1", "120", "240", "360°"]


@pytest.mark.parametrize(("angle_deg", "left_out"), [(110.0, "120"), (230.0, "240"), (0.0, "0"), (355.0, "360°")])
def test_an_angle_makes_room_for_the_jaw_at_it(angle_deg: float, left_out: str) -> None:
    rows = rows_of(high_at_the_end(marks=[AngleMark(angle_deg=angle_deg, label="1")]))
    assert rows[10].split() == [
        "mm",
        *sorted({"0", "120", "240", "360°"} - {left_out} | {"▴1"}, key=rows[10].find),
    ]
    assert left_out not in rows[10].split()


def test_inches_are_shown_in_inches() -> None:
    rows = rows_of(high_at_the_end(units=Units("inch")))
    assert rows[0].startswith("1.181 ")
    assert rows[-1].rstrip().endswith("uin/div")


@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (10, 3), (80, 24), (160, 48)])
def test_a_map_has_the_size_that_it_is_given(columns: int, rows: int) -> None:
    cells = map_cells(high_at_the_end(worst=4), columns, rows)
    assert (cells.columns, cells.rows) == (columns, rows)
