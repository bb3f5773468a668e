"""The programs of identification: what a card makes of them, and the table that the carriage goes along."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.identification.excitation import COLUMNS, PROGRAM, CamPath, PvtPath, wave_counts
from drivers.pmac.compensation.table import step_counts
from drivers.pmac.gathering.gather_client import GatheredData
from drivers.pmac.program_text import read_program
from profiles.machine import MachineProfile
from tests.drivers.families import machine as machine  # both families
from tests.drivers.identification_bench import ready


@pytest.mark.parametrize("frequency_hz", [1.0, 10.0, 50.0, 225.0])
def test_a_program_is_one_that_the_card_takes_with_the_lease_in_its_loop(
    machine: MachineProfile, frequency_hz: float
) -> None:
    watchdog = "I5111>0" if machine.controller.family == "turbo" else "M70>0"
    for path in (PvtPath(machine, 25.0), CamPath(machine, 25.0, frequency_hz)):
        sweep = path.sweep(frequency_hz, 8)
        program = read_program(sweep.text)
        assert program.number == PROGRAM
        assert sum(watchdog in line for line in program.lines) == 1
        assert 8.0 / frequency_hz < sweep.longest_s - sweep.steady_s < 8.0 / frequency_hz + 3.0


def test_a_program_ends_by_itself_when_nobody_ends_it(machine: MachineProfile) -> None:
    """Without a heartbeat on the card its lease runs out at once, so it is given one that lasts."""
    made = ready(machine)
    sweep = PvtPath(machine, 50.0).sweep(50.0, 10)
    lathe = made.rig.lathe
    lathe.program.load(read_program(sweep.text))
    began_s = made.sim.now_s()
    lathe.program.start(PROGRAM, 0.0)
    snapshot = lathe.program.follow(lambda _: None, sweep.longest_s + 15.0)
    assert made.sim.now_s() - began_s == pytest.approx(sweep.longest_s, abs=0.5)
    assert abs(snapshot.tool.position) <= 4.0


def test_the_tool_is_told_a_sine_about_its_centre(machine: MachineProfile) -> None:
    """In the steady part: 250 counts of amplitude about -500, within 0.05 um of a sine."""
    made = ready(machine)
    motor = made.sim.controller.motors[machine.tool.motor]
    sweep = PvtPath(machine, 50.0, centre_counts=-500.0).sweep(70.0, 40)
    made.tell(f"#{machine.tool.motor}J=-500")
    made.sim.wait(1.0)
    told: list[float] = []
    follow = motor.axis.follow

    def kept(commands: list[float]) -> list[float]:
        told.extend(commands)
        return follow(commands)

    made.rig.lathe.program.load(read_program(sweep.text))
    motor.axis.follow = kept  # type: ignore[method-assign,assignment]
    made.rig.lathe.program.start(PROGRAM, 0.0)
    made.rig.lathe.program.follow(lambda _: None, sweep.longest_s + 15.0)
    steady = np.array(told[2000:3000])
    time = np.arange(len(steady)) * machine.controller.servo_period_ms / 1000.0
    angle = 2 * np.pi * 70.0 * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(time)], axis=1)
    found, *_ = np.linalg.lstsq(basis, steady, rcond=None)
    assert math.hypot(found[0], found[1]) == pytest.approx(250.0, abs=0.25)
    assert found[2] == pytest.approx(-500.0, abs=0.05)
    assert np.abs(steady - basis @ found).max() < 0.25


def test_the_table_is_one_wave_that_begins_and_ends_at_nothing(machine: MachineProfile) -> None:
    path = CamPath(machine, 25.0, 80.0)
    table = path.table
    assert table is not None
    harmonic = wave_counts(machine, 80.0)
    places = np.arange(harmonic) + 0.5
    found = np.array([table.correction(float(place)) for place in places])
    # A chord of a fortieth of a wave is within (pi / 40)^2 / 2 of the sine, entries within 1/32 count.
    target = 125.0 * np.sin(2 * np.pi * places / harmonic)
    assert np.abs(found - target).max() < 125.0 * (math.pi / COLUMNS) ** 2 / 2 + 1 / 32 + 0.05
    assert np.abs(found).max() <= 125.0
    assert step_counts(table, [0.0]) == 0.0
    assert step_counts(table, [3.0]) < 10.0


def test_the_reference_of_a_cam_is_what_the_table_says_for_where_the_carriage_was(machine: MachineProfile) -> None:
    path = CamPath(machine, 25.0, 50.0)
    quarter = wave_counts(machine, 50.0) / 4.0
    data = GatheredData(
        times_ms=np.arange(4.0),
        values={"#3 actual": quarter * np.arange(4.0), "#1 actual": np.zeros(4)},
        units={},
    )
    assert path.reference_counts(data) == pytest.approx([0.0, 125.0, 0.0, -125.0], abs=0.1)


@pytest.mark.parametrize(("motors", "cycles"), [((1, 2, 3), 1), ((3, 1, 2), 0), ((2, 3, 1), 0)])
def test_how_old_the_carriage_is_follows_from_the_order_of_the_motors(
    machine: MachineProfile, motors: tuple[int, int, int], cycles: int
) -> None:
    """Tool, spindle, carriage: a source of a higher number than the target is seen one cycle late."""
    tool, spindle, carriage = motors
    definitions = tuple(f"#{motor}->{axis}" for motor, axis in zip(motors, "XYZ", strict=True))
    other = replace(
        machine,
        controller=replace(machine.controller, axis_definitions=definitions),
        tool=replace(machine.tool, motor=tool),
        spindle=replace(machine.spindle, motor=spindle),
        carriage=replace(machine.carriage, motor=carriage),
    )
    assert CamPath(other, 25.0, 50.0).late_cycles == cycles
