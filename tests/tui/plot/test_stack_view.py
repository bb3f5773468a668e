"""A stack of sections shows each profile between its Z and its RONt, and never hides the worst."""

from __future__ import annotations

import numpy as np
import pytest

from console.tui.plot.polar_view import AngleMark
from console.tui.plot.stack_view import SectionStack, fitting_half_um, stack_cells
from console.units import Units
from profiles.arrays import floats
from profiles.metrology.unrolled import TURN_DEG, UnrolledPart


def part(*lobes_um: float) -> UnrolledPart:
    """Sections at Z 20, 22 and so on, with a lobe of this amplitude and a maximum at 60 degrees."""
    lobe = np.cos(np.radians(3.0 * (TURN_DEG - 60.0)))
    return UnrolledPart(
        z_mm=floats(20.0 + 2.0 * np.arange(len(lobes_um))),
        ront_um=2.0 * np.array(lobes_um),
        deviation_um=np.array(lobes_um)[:, None] * lobe,
    )


def rows_of(shown: UnrolledPart, columns: int = 60, rows: int = 11, units: Units | None = None) -> list[str]:
    picture = SectionStack(
        part=shown,
        half_um=fitting_half_um(shown, 1.0),
        marks=[AngleMark(angle_deg=60.0, label="1")],
        units=units or Units("metric"),
    )
    return stack_cells(picture, columns, rows).text_rows()


def test_the_free_end_is_at_the_top_and_the_worst_is_marked() -> None:
    heights = [row[:4] for row in rows_of(part(4.0, 2.0, 1.0), rows=10) if row[:4].strip()]
    assert heights == ["24.0", "22.0", "20.0", "  mm"]
    named = [row for row in rows_of(part(4.0, 2.0, 1.0), rows=10) if "▸" in row]
    assert len(named) == 1 and named[0].startswith("20.0▸") and named[0].rstrip().endswith("8.00")


def test_all_profiles_are_on_one_scale() -> None:
    """4 um fill a strip of 3 rows, 0.4 um do not leave the middle one."""
    rows = rows_of(part(4.0, 0.4, 0.4), rows=10)
    drawn = [any("⠁" <= each <= "⣿" for each in row[5:50]) for row in rows]
    assert drawn[:9] == [False, True, False, False, True, False, True, True, True]


def test_where_rows_are_few_the_worst_stays() -> None:
    shown = part(*(5.0 if place == 17 else 1.0 for place in range(40)))
    rows = rows_of(shown, rows=6)
    assert sum(row[:4].strip(" ").replace(".", "").isdigit() for row in rows) <= 5
    assert any(row.startswith("54.0▸") for row in rows)


def test_the_angles_and_jaw_1_stand_below_and_the_unit_is_that_of_the_display() -> None:
    foot = rows_of(part(4.0, 2.0, 1.0), rows=10)[9]
    assert foot.split() == ["mm", "0", "▴1", "120", "240", "360°", "RONt", "um"]
    inches = rows_of(part(4.0, 2.0, 1.0), rows=10, units=Units("inch"))
    assert inches[9].split()[0] == "in" and inches[1].startswith("0.945")


@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (8, 2), (80, 24), (160, 48)])
def test_a_stack_has_the_size_that_it_is_given(columns: int, rows: int) -> None:
    cells = stack_cells(SectionStack(part=part(1.0, 2.0, 3.0), half_um=3.0), columns, rows)
    assert (cells.columns, cells.rows) == (columns, rows)
    assert not stack_cells(SectionStack(), columns, rows).text_rows()[0].strip()


def test_the_scale_holds_every_profile_with_two_digits() -> None:
    assert fitting_half_um(part(20.6, 1.0, 1.0), 1.0) == pytest.approx(21.0)
    assert fitting_half_um(part(0.0, 0.0, 0.0), 1.0) == pytest.approx(0.1)
