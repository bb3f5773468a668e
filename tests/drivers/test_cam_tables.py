"""Compensation tables: what they add and when a switch throws; and what motors do by them."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import NamedTuple, Protocol, cast

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

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
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.errors import PmacError
from profiles.machine import MachineProfile
from tests.drivers.conftest import Recorder
from tests.drivers.wire_card import Wire, wire

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
    return definition.fill_table(draw(st.lists(entries, min_size=count, max_size=count)))


def cam(*sixteenths: int, span: int = 4000) -> CompensationTable:
    return read_table([f"#1DEFINE COMP {len(sixteenths)},#1,#2,{span}", " ".join(map(str, sixteenths))], MOTORS)


def test_an_entry_of_160_is_10_counts_and_positions_fold_at_both_ends() -> None:
    table = read_table([EIGHT, "160 0 0 0", "0 0 0 0"], MOTORS)
    assert table.correction(500) == 10.0
    assert table.correction(4250) == 5.0
    assert table.correction(250) == 5.0
    assert table.correction(750) == 5.0
    assert table.correction(1000) == 0.0
    table = cam(0, 0, 0, 64)
    assert table.correction(0) == table.correction(4000) == table.correction(-8000) == 4.0
    assert table.correction(500) == 2.0
    table = cam(16, 32, 48, 0)
    assert table.correction(-1000) == table.correction(3000) == 3.0
    assert table.correction(-500) == 1.5


@given(st.lists(entries, min_size=1, max_size=30), spans, st.lists(positions, min_size=1, max_size=10))
@example([16, 0], 100, [-1e-300, -0.0, 100.0])
def test_between_entries_numpy_interpolates_alike(sixteenths: list[int], span: int, track: list[float]) -> None:
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
    (
        "#1 DEFINE COMP 0,#1,#2,4000 | #1 DEFINE COMP 1,#1,#2,0 | #1 DEFINE COMP 1,#9,#2,4000 | "
        "#1 DEFINE COMP 1,#1,#2D,4000 | #1 DEFINE COMP 1,#1,#2,#3,4000 | #1 DEFINE COMP 1 4000 | "
        "#1 DEFINE COMP 1.0,#1,#2,#3,4000,400 | #1 DEFINE COMP 1.1,4000,400 | "
        "#1 DEFINE COMP 1.1,#1,#2,#3,#4,4000,400 | #1 DEFINE COMP 1.1,#1,4000 | #1 DEFINE COMP 1,4000.5 | "
        "#1 DEFINE COMP 1,-4000 | DEFINE COMP 1,4000 | #1 COMP 1,4000"
    ).split(" | "),
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


def of(motor: int, size: int = 1) -> TableDefinition:
    return TableDefinition(motor=motor, sources=(TableSource(1, 4000),), target=motor, columns=size)


@pytest.mark.parametrize("buffer", ["GATHER", "ROTARY", "TCOMP", "BLCOMP", "TBUF", "LOOKAHEAD"])
def test_a_buffer_behind_the_tables_is_in_the_way(buffer: str) -> None:
    with pytest.raises(PmacError, match=f"DELETE {buffer} first") as refused:
        refuse_definition(of(2), (), {buffer}, 100)
    assert refused.value.code == 3
    with pytest.raises(PmacError, match=f"DELETE {buffer} first") as refused:
        refuse_deletion(2, {2}, {buffer})
    assert refused.value.code == 3


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


def test_a_way_has_the_extremes_that_lie_on_it_also_across_the_seam_of_a_grid() -> None:
    """Entries of 1, 5, -2 and 0 counts at 1000, 2000, 3000 and 4000."""
    table = cam(16, 80, -32, 0)
    assert correction_range(table, [(1000, 2500)]) == (1.0, 5.0)
    assert correction_range(table, [(2500, 3500)]) == (-2.0, 1.5)
    assert correction_range(table, [(3500, 4500)]) == (-1.0, 0.5)
    assert correction_range(table, [(-500, 500)]) == (-1.0, 0.5)
    assert correction_range(table, [(100, 4100)]) == (-2.0, 5.0)
    # Column 0 has 0 and 10, column 3 has 3 and 13 counts; in between row 0 and row 1.
    table = read_table(GRID, MOTORS)
    assert correction_range(table, [(290, 310), 0]) == (0.0, 3.0)
    assert correction_range(table, [(290, 310), 100]) == (10.0, 13.0)


def test_a_step_needs_a_position_for_each_source() -> None:
    with pytest.raises(ValueError, match=re.escape("1 positions for 2 sources")):
        step_counts(read_table(GRID, MOTORS), [0.0])


# A compensation table as an electronic cam: 27.5 um at 50 Hz, three times a turn of a spindle at 1000 rpm.

Floats = NDArray[np.float64]

TOOL, SPINDLE, CARRIAGE = 1, 2, 3
TURN = 10_000
AMPLITUDE = 137.5
"""27.5 um in counts of 0.2 um."""

COLUMNS, ROWS = 200, 4
SPAN_Z = 40_000
WAVE = np.sin(2.0 * np.pi * 3.0 * np.arange(COLUMNS + 1) / COLUMNS)
GAIN = np.array([0.0, 1.0, 1.0, 1.0, 0.0])
"""Of the rows along Z: the first and the last are zero."""

SPEED = 166.67
"""1000 rpm in counts/ms."""


class Rippling(Protocol):
    """A spindle whose speed is not even."""

    speed_ripple: float
    ripple_per_turn: int


class Tracks(NamedTuple):
    commands: Floats
    tool: Floats
    spindle: Floats


def sixteenths(counts: Floats) -> list[int]:
    return [int(value) for value in np.rint(16.0 * counts)]


def cam_by_angle(turn: int = TURN) -> CompensationTable:
    definition = TableDefinition(motor=TOOL, sources=(TableSource(SPINDLE, turn),), target=TOOL, columns=COLUMNS)
    return definition.fill_table(sixteenths(AMPLITUDE * WAVE[1:]))


def cam_along_z() -> CompensationTable:
    sources = (TableSource(SPINDLE, TURN), TableSource(CARRIAGE, SPAN_Z))
    definition = TableDefinition(motor=TOOL, sources=sources, target=TOOL, columns=COLUMNS, rows=ROWS)
    return definition.fill_table(sixteenths(AMPLITUDE * np.outer(GAIN, WAVE).ravel()[1:]))


def set_up(machine: MachineProfile, dialect: Dialect, table: CompensationTable, z_counts: int = 15_000) -> Wire:
    """A card with a table, the tool and the carriage in their loops, the spindle at speed, I51 still 0."""
    card = wire(machine, dialect)
    card.tell(*table_lines(table), f"I222={SPEED}", "I219=1", "#1J/", f"#3J={z_counts}")
    card.settle()
    card.tell("#2J+")
    card.sim.wait(1.0)
    return card


def record(card: Wire, motor: int) -> Recorder:
    recorder = Recorder(card.card.motors[motor].axis)
    card.card.motors[motor].axis = recorder
    return recorder


def run(card: Wire, seconds: float) -> Tracks:
    tool, spindle = record(card, TOOL), record(card, SPINDLE)
    card.sim.wait(seconds)
    return Tracks(*map(np.array, (tool.commands, tool.positions, spindle.positions)))


def ripple(card: Wire, share: float) -> None:
    cast("Rippling", card.card.motors[SPINDLE].axis).speed_ripple = share


def by_numpy(entries: Floats, spindle_counts: Floats) -> Floats:
    """The table as a function of the angle, by somebody else's straight lines."""
    angles = np.arange(COLUMNS + 1) * TURN / COLUMNS
    return np.interp(np.mod(spindle_counts, TURN), angles, np.rint(16.0 * entries) / 16.0)


def lobe(tracks: Tracks) -> tuple[float, float]:
    """The amplitude (counts) and the lag (rad) of the tool at three a turn of the angle that the spindle had."""
    angle = 6.0 * np.pi * tracks.spindle / TURN
    basis = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)
    (sine, cosine, _), *_ = np.linalg.lstsq(basis, tracks.tool, rcond=None)
    return float(np.hypot(sine, cosine)), float(-np.arctan2(cosine, sine))


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])
def test_a_cam_follows_the_actual_angle_through_a_ripple(machine: MachineProfile, dialect: Dialect) -> None:
    card = set_up(machine, dialect, cam_by_angle())
    ripple(card, 0.05)
    card.tell("I51=1")
    card.sim.wait(0.2)
    tracks = run(card, 0.5)
    speeds = np.diff(tracks.spindle)
    assert 0.09 < (speeds.max() - speeds.min()) / speeds.mean() < 0.11
    # Motor 2 is looked at behind motor 1: its angle is that of the cycle before.
    before = np.rint(tracks.spindle[:-1])
    assert tracks.commands[1:] == pytest.approx(by_numpy(AMPLITUDE * WAVE, before), abs=1e-9)
    # A path by time, at the same mean speed, would have been somewhere else by more than a micrometre.
    even: Floats = np.asarray(
        np.polyval(np.polyfit(np.arange(len(before)), before, 1), np.arange(len(before))), np.float64
    )
    assert np.abs(by_numpy(AMPLITUDE * WAVE, even) - tracks.commands[1:]).max() > 5.0


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])
def test_a_cam_that_changes_along_z_follows_both_of_its_sources(machine: MachineProfile, dialect: Dialect) -> None:
    from scipy.interpolate import RegularGridInterpolator

    card = set_up(machine, dialect, cam_along_z(), z_counts=5_000)
    ripple(card, 0.05)
    carriage = record(card, CARRIAGE)
    card.tell("I51=1", "#3J=35000")
    tracks = run(card, 1.0)
    z_counts = np.array(carriage.positions)
    assert z_counts[-1] > 12_000
    places = (np.arange(ROWS + 1) * SPAN_Z / ROWS, np.arange(COLUMNS + 1) * TURN / COLUMNS)
    entries = np.rint(16.0 * AMPLITUDE * np.outer(GAIN, WAVE)) / 16.0
    bilinear = RegularGridInterpolator(places, entries)
    z_before, turn_before = np.rint(z_counts[:-1]), np.mod(np.rint(tracks.spindle[:-1]), TURN)
    expected = bilinear(np.stack([z_before, turn_before], axis=1))
    assert tracks.commands[1:] == pytest.approx(expected, abs=1e-9)


def test_the_tool_follows_the_cam_as_its_servo_does_with_the_feedforward_in_it(machine: MachineProfile) -> None:
    card = set_up(machine, PMAC, cam_by_angle())
    card.tell("I51=1")
    card.sim.wait(0.2)
    amplitude, _ = lobe(run(card, 1.2))
    # 0.885 at 50 Hz is what the loop of the paper does with its derivative on the error; 0.162 is without.
    assert amplitude / AMPLITUDE == pytest.approx(0.885, abs=0.01)


def test_the_cam_holds_its_phase_through_a_ripple_but_for_what_the_servo_lags(machine: MachineProfile) -> None:
    lags = []
    for share in (0.0, 0.05):
        card = set_up(machine, PMAC, cam_by_angle())
        ripple(card, share)
        card.tell("I51=1")
        card.sim.wait(0.2)
        lags.append(lobe(run(card, 1.2)))
    (even, lag), (rippled, rippled_lag) = lags
    assert rippled == pytest.approx(even, rel=0.01)
    assert rippled_lag == pytest.approx(lag, abs=0.01)


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])
def test_switching_outside_a_zero_row_makes_the_step(machine: MachineProfile, dialect: Dialect) -> None:
    table = cam_along_z()
    card = wire(machine, dialect)
    card.tell(*table_lines(table), "#1J/", "#2J=1000", "#3J=15000")
    card.settle()
    thrown = step_counts(table, (1000, 15_000))
    assert thrown == pytest.approx(AMPLITUDE * np.sin(0.6 * np.pi), abs=0.05)  # 1000 of 10000 counts, three lobes
    tool = record(card, TOOL)
    card.tell("I51=1")
    card.sim.wait(0.05)
    assert np.abs(np.diff([0.0, *tool.commands])).max() == pytest.approx(thrown)
    card.tell("I51=0", "#3J=0")
    card.settle()
    # What was added last stays, wherever the sources are by now, and with the table off.
    assert tool.commands[-1] == pytest.approx(thrown)
    card.tell("M169->" + ("D:$46" if dialect is PMAC else "D:$90"))
    assert float(card.ask("M169")[0]) == pytest.approx(thrown * 96 * 32, abs=1)
    # In the row of zeros it is switched without a step, but for the correction that was left over.
    card.tell("M169=0")
    card.sim.wait(0.05)
    tool.commands.clear()
    card.tell("I51=1")
    card.sim.wait(0.05)
    assert np.abs(tool.commands).max() == 0.0


@pytest.mark.parametrize("source", [SPINDLE, CARRIAGE])
def test_a_source_of_a_higher_number_is_one_cycle_old(machine: MachineProfile, source: int) -> None:
    target = CARRIAGE if source == SPINDLE else SPINDLE
    definition = TableDefinition(motor=target, sources=(TableSource(source, 1000),), target=target, columns=10)
    card = wire(machine)
    card.tell(*table_lines(definition.fill_table([160 * k for k in range(1, 10)] + [0])), f"#{target}J/")
    led, leading = record(card, target), record(card, source)
    card.tell("I51=1", f"#{source}J=900")
    card.settle()
    there = np.rint(leading.positions)
    seen = there if source < target else there[:-1]
    expected = np.interp(np.mod(seen, 1000), np.arange(11) * 100.0, [*range(0, 100, 10), 0])
    assert there[-1] == 900
    assert np.array(led.commands[len(led.commands) - len(seen) :]) == pytest.approx(expected, abs=1e-9)


def test_contributions_of_several_tables_and_of_desired_positions_add_up(machine: MachineProfile) -> None:
    second = TableDefinition(motor=2, sources=(TableSource(2, 1000, desired=True),), target=1, columns=2)
    first = TableDefinition(motor=1, sources=(TableSource(3, 1000),), target=1, columns=2)
    card = wire(machine)
    card.tell(*table_lines(second.fill_table([320, 0])), *table_lines(first.fill_table([1600, 0])))
    card.tell("#1J/#2J=250#3J=500")
    card.settle()
    card.tell("I51=1")
    card.sim.wait(0.01)
    assert card.card.motors[1].correction == 100.0 + 10.0


def test_a_motor_is_closed_without_a_kick_while_a_correction_is_on(machine: MachineProfile) -> None:
    card = wire(machine)
    card.tell("M169->D:$46", "#1J/")
    card.sim.wait(0.1)
    card.tell(f"M169={50 * 96 * 32}")
    card.sim.wait(0.5)
    assert float(card.ask("#1P")[0]) == pytest.approx(50, abs=1)
    card.tell("#1K")
    card.sim.wait(0.2)
    tool = record(card, TOOL)
    card.tell("#1J/")
    card.sim.wait(0.2)
    assert np.ptp(tool.positions) <= 2.0
    card.tell("#1J=1000")
    card.settle()
    assert float(card.ask("#1P")[0]) == pytest.approx(1050, abs=1)


def test_nothing_changes_in_a_track_while_no_table_is_on(machine: MachineProfile) -> None:
    tracks = []
    for table in (None, cam_by_angle()):
        card = wire(machine)
        if table is not None:
            card.tell(*table_lines(table))
        tool = record(card, TOOL)
        card.tell("#1J/")
        card.sim.wait(0.1)
        card.tell("#1J=20000")
        card.settle()
        tracks.append(tool.positions)
    assert tracks[0] == tracks[1]
