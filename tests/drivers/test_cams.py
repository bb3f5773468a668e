"""A compensation table as an electronic cam: 27.5 um at 50 Hz, three times a turn of a spindle at 1000 rpm."""

from __future__ import annotations

from typing import NamedTuple, Protocol, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.pmac.compensation.table import CompensationTable, TableDefinition, TableSource, step_counts
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.conftest import Recorder
from tests.drivers.wire_card import Wire, wire

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


def cam(turn: int = TURN) -> CompensationTable:
    definition = TableDefinition(motor=TOOL, sources=(TableSource(SPINDLE, turn),), target=TOOL, columns=COLUMNS)
    return definition.filled(sixteenths(AMPLITUDE * WAVE[1:]))


def cam_along_z() -> CompensationTable:
    sources = (TableSource(SPINDLE, TURN), TableSource(CARRIAGE, SPAN_Z))
    definition = TableDefinition(motor=TOOL, sources=sources, target=TOOL, columns=COLUMNS, rows=ROWS)
    return definition.filled(sixteenths(AMPLITUDE * np.outer(GAIN, WAVE).ravel()[1:]))


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
def test_a_cam_follows_the_actual_angle_through_a_ripple_of_the_speed(
    machine: MachineProfile, dialect: Dialect
) -> None:
    card = set_up(machine, dialect, cam())
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
    card = set_up(machine, PMAC, cam())
    card.tell("I51=1")
    card.sim.wait(0.2)
    amplitude, _ = lobe(run(card, 1.2))
    # 0.885 at 50 Hz is what the loop of the paper does with its derivative on the error; 0.162 is without.
    assert amplitude / AMPLITUDE == pytest.approx(0.885, abs=0.01)


def test_the_cam_holds_its_phase_through_a_ripple_but_for_what_the_servo_lags(machine: MachineProfile) -> None:
    lags = []
    for share in (0.0, 0.05):
        card = set_up(machine, PMAC, cam())
        ripple(card, share)
        card.tell("I51=1")
        card.sim.wait(0.2)
        lags.append(lobe(run(card, 1.2)))
    (even, lag), (rippled, rippled_lag) = lags
    assert rippled == pytest.approx(even, rel=0.01)
    assert rippled_lag == pytest.approx(lag, abs=0.01)


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])
def test_switching_outside_a_zero_row_makes_the_step_and_inside_none(
    machine: MachineProfile, dialect: Dialect
) -> None:
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
    card.tell(*table_lines(definition.filled([160 * k for k in range(1, 10)] + [0])), f"#{target}J/")
    led, leading = record(card, target), record(card, source)
    card.tell("I51=1", f"#{source}J=900")
    card.settle()
    there = np.rint(leading.positions)
    seen = there if source < target else there[:-1]
    expected = np.interp(np.mod(seen, 1000), np.arange(11) * 100.0, [*range(0, 100, 10), 0])
    assert there[-1] == 900
    assert np.array(led.commands[len(led.commands) - len(seen) :]) == pytest.approx(expected, abs=1e-9)


def test_contributions_of_several_tables_add_up_and_the_desired_position_can_be_a_source(
    machine: MachineProfile,
) -> None:
    second = TableDefinition(motor=2, sources=(TableSource(2, 1000, desired=True),), target=1, columns=2)
    first = TableDefinition(motor=1, sources=(TableSource(3, 1000),), target=1, columns=2)
    card = wire(machine)
    card.tell(*table_lines(second.filled([320, 0])), *table_lines(first.filled([1600, 0])))
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
    for table in (None, cam()):
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
