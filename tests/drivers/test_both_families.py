"""Motors and coordinate systems of both families, with and without the lathe behind them."""

from __future__ import annotations

import time

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

FAMILIES = pytest.mark.parametrize(
    ("dialect", "motors", "systems"), [(PMAC, 8, 8), (TURBO, 32, 16)], ids=["pmac", "turbo"]
)


@FAMILIES
def test_every_number_has_its_motor_and_its_system(
    machine: MachineProfile, dialect: Dialect, motors: int, systems: int
) -> None:
    controller = SimulatedLathe(machine, dialect=dialect).controller
    assert list(controller.motors) == list(range(1, motors + 1))
    assert list(controller.systems) == list(range(1, systems + 1))
    assert controller.dialect is dialect


@FAMILIES
def test_the_lathe_is_behind_the_first_three_and_what_is_not_activated_is_off(
    machine: MachineProfile, dialect: Dialect, motors: int, systems: int
) -> None:
    controller = SimulatedLathe(machine, dialect=dialect).controller
    assert [motor.number for motor in controller.motors.values() if motor.activated] == [1, 2, 3]
    assert set(controller.run_block(11)) == {1, 2, 3}
    assert set(controller.systems[1].frame.definitions) == {1, 2, 3}


@FAMILIES
def test_a_motor_without_a_machine_is_where_it_is_told_to_be(
    machine: MachineProfile, dialect: Dialect, motors: int, systems: int
) -> None:
    sim = SimulatedLathe(machine, dialect=dialect)
    port = sim.connect()
    port.receive(f"I3=2 I6=1 I{motors}00=1 I{motors}17=0 #{motors}J/ &{systems}#{motors}->1000X\r".encode())
    sim.wait(0.02)
    port.receive(f"OPEN PROG 1 CLEAR\rABS TA50 TS0 TM100 X2\rCLOSE\r&{systems}B1R\r".encode())
    sim.wait(0.4)
    port.take_output()
    port.receive(f"#{motors}P&{systems}??\r".encode())
    sim.wait(0.01)
    position, status = port.take_output().decode().split("\r")[:2]
    assert position == "2000"
    assert len(status) == 6 * dialect.system_words


@FAMILIES
def test_any_motor_finds_a_home_trigger_in_either_direction(
    machine: MachineProfile, dialect: Dialect, motors: int, systems: int
) -> None:
    controller = SimulatedLathe(machine, dialect=dialect).controller
    port = SimulatedLathe(machine, dialect=dialect)
    motor = port.controller.motors[5]
    host = port.connect()
    for speed in (5, -5):
        host.receive(f"I500=1 I519=0 I523={speed} #5HM\r".encode())
        port.wait(1.0)
        assert motor.home_complete and not motor.jogging
        assert motor.position == 0
    assert not controller.motors[5].home_complete


def test_thirty_two_motors_that_are_off_cost_no_more_than_eight(machine: MachineProfile) -> None:
    """The best of several runs of each; the machine is shared, so that the bound is wide."""

    def best_s(dialect: Dialect) -> float:
        sim = SimulatedLathe(machine, dialect=dialect)
        times = []
        for _ in range(7):
            start = time.process_time()
            sim.wait(0.5)
            times.append(time.process_time() - start)
        return min(times)

    assert best_s(TURBO) < 1.5 * best_s(PMAC)
