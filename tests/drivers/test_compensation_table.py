"""Compensation tables: what they add, how they are written, when they may be defined, when a switch throws."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.pmac.compensation.table import (
    CompensationTable,
    TableDefinition,
    TableSource,
    correction_range,
    refuse_definition,
    refuse_deletion,
    step_counts,
)
from drivers.pmac.compensation.table_text import definition_text, read_table, table_lines
from drivers.pmac.language.errors import PmacError

MOTORS = 8
EIGHT = "#1 DEFINE COMP 8,#1,#2,4000"
# Three rows of four: the origin, which is not sent, and eleven entries.
GRID = ("#2 DEFINE COMP 2.3,#1D,#3,#2,300,200", "16 32 48", "160 176 192 208", "320 336 352 368")

entries = st.integers(-(2**23), 2**23 - 1)
spans = st.integers(1, 10**6)
positions = st.integers(-(2**28), 2**28).map(lambda parts: parts / 32)
"""Converted positions have five bits of fraction."""


@st.composite
def tables(draw: st.DrawFn) -> CompensationTable:
    two = draw(st.booleans())
    motors = st.integers(1, MOTORS)
    definition = TableDefinition(
        motor=draw(motors),
        sources=tuple(TableSource(draw(motors), draw(spans), draw(st.booleans())) for _ in range(1 + two)),
        target=draw(motors),
        columns=draw(st.integers(1, 20)),
        rows=draw(st.integers(1, 4)) if two else 0,
    )
    count = definition.entry_count
    return definition.filled(draw(st.lists(entries, min_size=count, max_size=count)))


def cam(*sixteenths: int, span: int = 4000) -> CompensationTable:
    return read_table([f"#1DEFINE COMP {len(sixteenths)},#1,#2,{span}", " ".join(map(str, sixteenths))], MOTORS)


def test_an_entry_of_160_is_10_counts_and_a_position_beyond_the_span_folds() -> None:
    table = read_table([EIGHT, "160 0 0 0", "0 0 0 0"], MOTORS)
    assert table.correction(500) == 10.0
    assert table.correction(4250) == 5.0
    assert table.correction(250) == 5.0
    assert table.correction(750) == 5.0
    assert table.correction(1000) == 0.0


def test_at_zero_the_last_entry_counts() -> None:
    table = cam(0, 0, 0, 64)
    assert table.correction(0) == table.correction(4000) == table.correction(-8000) == 4.0
    assert table.correction(500) == 2.0


def test_negative_positions_count_from_the_upper_end() -> None:
    table = cam(16, 32, 48, 0)
    assert table.correction(-1000) == table.correction(3000) == 3.0
    assert table.correction(-500) == 1.5


@given(st.lists(entries, min_size=1, max_size=30), spans, st.lists(positions, min_size=1, max_size=10))
@example([16, 0], 100, [-1e-300, -0.0, 100.0])
def test_between_entries_it_is_what_numpy_interpolates(
    sixteenths: list[int], span: int, track: list[float]
) -> None:
    table = cam(*sixteenths, span=span)
    knots = np.arange(1, len(sixteenths) + 1) * span / len(sixteenths)
    expected = np.interp(track, knots, np.array(sixteenths) / 16, period=span)
    assert np.allclose([table.correction(place) for place in track], expected, rtol=1e-9, atol=1e-6)


def test_rows_and_columns_are_sent_row_by_row_without_the_origin() -> None:
    table = read_table(GRID, MOTORS)
    assert table.correction(0, 0) == 0.0
    assert table.correction(100, 0) == 1.0
    assert table.correction(200, 0) == 2.0
    assert table.correction(0, 100) == 10.0
    assert table.correction(100, 100) == 11.0
    assert table.correction(299.999999, 100) == pytest.approx(13.0)
    assert table.correction(200, 199.999999) == pytest.approx(22.0)


def test_the_row_motor_moves_along_a_row_and_the_column_motor_chooses_it() -> None:
    sources = read_table(GRID, MOTORS).definition.sources
    assert sources == (TableSource(1, 300, desired=True), TableSource(3, 200))


@given(tables().filter(lambda table: table.definition.rows > 0), positions, positions)
def test_between_rows_and_columns_it_is_bilinear(table: CompensationTable, along: float, across: float) -> None:
    definition = table.definition
    flat = [Fraction(0), *(Fraction(entry, 16) for entry in table.entries)]

    def folded(position: float, span: int, size: int) -> tuple[int, Fraction]:
        place = Fraction(position) % span * size / span
        return int(place), place - int(place)

    (column, u), (row, v) = (
        folded(position, source.span_counts, size)
        for position, source, size in zip(
            (along, across), definition.sources, (definition.columns, definition.rows), strict=True
        )
    )
    at = [flat[(row + down) * (definition.columns + 1) + column + right] for down in (0, 1) for right in (0, 1)]
    expected = (at[0] * (1 - u) + at[1] * u) * (1 - v) + (at[2] * (1 - u) + at[3] * u) * v
    assert table.correction(along, across) == pytest.approx(float(expected), rel=1e-9, abs=1e-6)


def test_each_source_needs_its_position() -> None:
    with pytest.raises(ValueError, match="1 positions for 2 sources"):
        read_table(GRID, MOTORS).correction(5.0)


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("#1 DEFINE COMP 8,#1,#2,4000", "8,#1,#2,4000"),
        ("#4DEF COMP 8,4000", "8,#4,#4,4000"),
        ("#4 define comp 8, #2D, 4000", "8,#2D,#4,4000"),
        ("#3 DEFINE COMP 1.7,#1,300,200", "1.7,#1,#3,#3,300,200"),
        ("#3 DEFINE COMP 1.7,#1D,#2D,300,200", "1.7,#1D,#2D,#3,300,200"),
        ("#3 DEFINE COMP 1.7,#1,#2D,#5,300,200", "1.7,#1,#2D,#5,300,200"),
    ],
)
def test_motors_that_are_left_out_are_the_addressed_one(line: str, meant: str) -> None:
    count = 8 if line.count("8") else 15
    assert definition_text(read_table([line, "0 " * count], MOTORS).definition) == meant


@pytest.mark.parametrize(
    "line",
    [
        "#1 DEFINE COMP 0,#1,#2,4000",
        "#1 DEFINE COMP 1,#1,#2,0",
        "#1 DEFINE COMP 1,#9,#2,4000",
        "#1 DEFINE COMP 1,#1,#2D,4000",
        "#1 DEFINE COMP 1,#1,#2,#3,4000",
        "#1 DEFINE COMP 1 4000",
        "#1 DEFINE COMP 1.0,#1,#2,#3,4000,400",
        "#1 DEFINE COMP 1.1,4000,400",
        "#1 DEFINE COMP 1.1,#1,#2,#3,#4,4000,400",
        "#1 DEFINE COMP 1.1,#1,4000",
        "#1 DEFINE COMP 1,4000.5",
        "#1 DEFINE COMP 1,-4000",
        "DEFINE COMP 1,4000",
        "#1 COMP 1,4000",
    ],
)
def test_what_is_no_definition_is_an_error_003(line: str) -> None:
    with pytest.raises(PmacError) as refused:
        read_table([line, "0"], MOTORS)
    assert refused.value.code == 3


@pytest.mark.parametrize("sent", ["1.5", "8388608", "-8388609", "X", "- ", ".5"])
def test_entries_are_whole_numbers_of_24_bits(sent: str) -> None:
    with pytest.raises(PmacError) as refused:
        read_table(["#1 DEFINE COMP 1,4000", sent], MOTORS)
    assert refused.value.code == 3


@pytest.mark.parametrize("sent", ["1", "1 2 3"])
def test_the_number_of_entries_must_be_the_one_of_the_definition(sent: str) -> None:
    with pytest.raises(PmacError, match="asks for 2"):
        read_table(["#1 DEFINE COMP 2,4000", sent], MOTORS)


@given(tables())
def test_what_is_sent_is_what_is_read(table: CompensationTable) -> None:
    lines = table_lines(table)
    assert read_table(lines, MOTORS) == table
    assert max(map(len, lines)) <= 255


def test_tables_are_defined_from_high_to_low_and_deleted_from_low_to_high() -> None:
    defined: set[int] = set()
    order = (5, 2, 1)
    for motor in order:
        refuse_definition(of(motor), defined, (), 100)
        defined.add(motor)
    for motor in reversed(order):
        refuse_deletion(motor, defined, ())
        defined.remove(motor)


def of(motor: int, size: int = 1) -> TableDefinition:
    return TableDefinition(motor=motor, sources=(TableSource(1, 4000),), target=motor, columns=size)


def test_a_table_of_a_lower_motor_is_in_the_way() -> None:
    with pytest.raises(PmacError, match=r"lower motors \(1\)") as refused:
        refuse_definition(of(2), {1, 4}, (), 100)
    assert refused.value.code == 3
    with pytest.raises(PmacError, match=r"lower motors \(1, 2\)") as refused:
        refuse_deletion(4, {1, 2, 4}, ())
    assert refused.value.code == 3


@pytest.mark.parametrize("buffer", ["GATHER", "ROTARY", "TCOMP", "BLCOMP", "TBUF", "LOOKAHEAD"])
def test_a_buffer_behind_the_tables_is_in_the_way(buffer: str) -> None:
    with pytest.raises(PmacError, match=f"DELETE {buffer} first") as refused:
        refuse_definition(of(2), (), {buffer}, 100)
    assert refused.value.code == 3
    with pytest.raises(PmacError, match=f"DELETE {buffer} first") as refused:
        refuse_deletion(2, {2}, {buffer})
    assert refused.value.code == 3


def test_a_motor_has_one_table_and_memory_ends() -> None:
    with pytest.raises(PmacError, match="has a table already") as refused:
        refuse_definition(of(2), {2}, (), 100)
    assert refused.value.code == 3
    refuse_definition(of(2, 100), (), (), 100)
    with pytest.raises(PmacError, match="101 entries; room for 100") as refused:
        refuse_definition(of(2, 101), (), (), 100)
    assert refused.value.code == 6
    refuse_deletion(3, {1, 2}, {"GATHER"})  # no table of motor 3: nothing to refuse


def test_switching_a_cam_where_it_is_not_zero_throws_the_tool() -> None:
    table = cam(0, 320, 0, 0)
    assert step_counts(table, [2000]) == 20.0
    assert step_counts(table, [1000]) == 0.0
    assert step_counts(table, [None]) == 20.0
    assert step_counts(table, [2000], held_counts=20.0) == 0.0
    assert step_counts(table, [1000], held_counts=20.0) == 20.0


def test_a_row_of_zeros_may_be_switched_at_any_angle_of_the_spindle() -> None:
    zero, cut = "0 0 0 0", "-32 0 80 -32"
    table = read_table(["#2 DEFINE COMP 3.3,#1,#3,#2,10000,3000", "0 0 0", cut, cut, zero], MOTORS)
    assert step_counts(table, [None, 0]) == 0.0
    assert step_counts(table, [None, 1000]) == 5.0
    assert step_counts(table, [None, 500]) == 2.5  # half way up from the row of zeros
    assert step_counts(table, [0, 1500]) == 2.0
    assert step_counts(table, [0, None]) == 2.0
    assert step_counts(table, [None, None]) == 5.0


@given(tables(), st.data())
def test_no_switch_is_worse_than_the_worst(table: CompensationTable, data: st.DataObject) -> None:
    places = [data.draw(positions) for _ in table.definition.sources]
    step = step_counts(table, places)
    assert step == abs(table.correction(*places))
    assert step <= step_counts(table, [None] * len(places)) + 1e-6
    assert step <= step_counts(table, [None, *places[1:]]) + 1e-6


@given(tables(), st.data())
def test_a_range_holds_every_correction_on_the_way(table: CompensationTable, data: st.DataObject) -> None:
    ways = [sorted(data.draw(st.tuples(positions, positions))) for _ in table.definition.sources]
    low, high = correction_range(table, [(first, last) for first, last in ways])
    for share in (0.0, 0.3, 0.5, 0.9, 1.0):
        at = [first + share * (last - first) for first, last in ways]
        assert low - 1e-6 <= table.correction(*at) <= high + 1e-6
    everywhere = correction_range(table, [None] * len(ways))
    assert everywhere[0] - 1e-6 <= low <= high <= everywhere[1] + 1e-6


def test_a_way_has_the_extremes_that_lie_on_it() -> None:
    """Entries of 1, 5, -2 and 0 counts at 1000, 2000, 3000 and 4000."""
    table = cam(16, 80, -32, 0)
    assert correction_range(table, [(1000, 2500)]) == (1.0, 5.0)
    assert correction_range(table, [(2500, 3500)]) == (-2.0, 1.5)
    assert correction_range(table, [(3500, 4500)]) == (-1.0, 0.5)
    assert correction_range(table, [(-500, 500)]) == (-1.0, 0.5)
    assert correction_range(table, [(100, 4100)]) == (-2.0, 5.0)


def test_a_way_across_the_seam_of_a_grid_meets_both_its_edges() -> None:
    """Column 0 has 0 and 10, column 3 has 3 and 13 counts; in between row 0 and row 1."""
    table = read_table(GRID, MOTORS)
    assert correction_range(table, [(290, 310), 0]) == (0.0, 3.0)
    assert correction_range(table, [(290, 310), 100]) == (10.0, 13.0)


def test_a_step_needs_a_position_for_each_source() -> None:
    with pytest.raises(ValueError, match=re.escape("1 positions for 2 sources")):
        step_counts(read_table(GRID, MOTORS), [0.0])
