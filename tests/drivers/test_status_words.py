"""Status words bit by bit, as the Software Reference lists them for the non-Turbo controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.pmac.dialect import PMAC
from drivers.pmac.status import decode, digits_of, pack

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

ACTIVATED, OPEN_LOOP, TIMER, INTEGRATION, STILL, ABORTING, HOMING = 23, 18, 17, 16, 13, 12, 10
ASSIGNED, AMPLIFIER, HOMED, TRIGGER, FATAL, WARNING, ARRIVED = 23, 14, 10, 7, 2, 1, 0
Z_FRAX, Z_INC, Y_FRAX, Y_INC, X_FRAX, X_INC, R_INC, BY_TIME, RUNNING = 23, 22, 21, 20, 19, 18, 5, 3, 0
RUNTIME_ERROR, SYSTEM_FATAL, SYSTEM_WARNING, SYSTEM_ARRIVED, SPLINE_OR_PVT, RAPID = 22, 19, 18, 17, 4, 1
AT_FIRST = (Z_FRAX, Y_FRAX, X_FRAX, R_INC)
"""The feedrate axes, and vectors to the centres of circles that are incremental."""


def bits(word: str) -> set[int]:
    return {bit for bit in range(24) if int(word, 16) >> bit & 1}


def words(bench: Bench, line: str) -> tuple[set[int], set[int]]:
    reply = bench.ask(line)
    assert len(reply) == 12
    assert reply == reply.upper()
    return bits(reply[:6]), bits(reply[6:])


def test_the_worked_example_of_the_manual_is_read_as_printed() -> None:
    assert decode("812000804401", PMAC.motor_bits) == {
        "activated",
        "integration_mode",
        "desired_velocity_zero",
        "assigned",
        "amplifier_enabled",
        "home_complete",
        "in_position",
    }


def test_the_worked_example_of_the_manual_is_what_a_homed_motor_answers(closed: Bench) -> None:
    closed.client.request("I134=1")
    closed.lathe.home()
    assert closed.ask("#1?") == "812000804401"


def test_the_example_of_a_coordinate_system_is_read_as_printed() -> None:
    names = decode("A8002A020010", PMAC.system_bits)
    assert names >= {"x_feedrate", "y_feedrate", "z_feedrate", "by_move_time", "single_step", "in_position"}
    assert "running_program" not in names
    assert "x_incremental" not in names


def test_a_killed_motor(bench: Bench) -> None:
    assert words(bench, "#1?") == ({ACTIVATED, OPEN_LOOP}, {ASSIGNED})


def test_a_motor_of_no_coordinate_system_and_one_of_the_third(bench: Bench) -> None:
    bench.client.request("#3->0")
    assert words(bench, "#3?")[1] == set()
    bench.client.request("&3 #3->Z")
    assert words(bench, "#3?")[1] == {ASSIGNED, 21}  # number - 1 in bits 22 to 20


def test_a_motor_in_closed_loop_at_rest(closed: Bench) -> None:
    closed.sim.wait(0.1)
    assert words(closed, "#1?") == ({ACTIVATED, STILL}, {ASSIGNED, AMPLIFIER, ARRIVED})


def test_a_jogging_motor(closed: Bench) -> None:
    closed.client.request("#3J+")
    closed.sim.wait(0.5)
    assert words(closed, "#3?") == ({ACTIVATED, TIMER, INTEGRATION}, {ASSIGNED, AMPLIFIER})


def test_an_aborting_motor(closed: Bench) -> None:
    closed.client.request("I315=0.01 #3J+")
    closed.sim.wait(0.5)
    closed.raw(b"\x01")
    assert words(closed, "#3?") == ({ACTIVATED, TIMER, INTEGRATION, ABORTING}, {ASSIGNED, AMPLIFIER})
    closed.settle()
    assert words(closed, "#3?") == ({ACTIVATED, STILL, INTEGRATION}, {ASSIGNED, AMPLIFIER, ARRIVED})


def test_a_homing_motor_and_a_homed_one(closed: Bench) -> None:
    closed.client.request("#3HM")
    closed.sim.wait(0.02)
    assert words(closed, "#3?") == ({ACTIVATED, TIMER, INTEGRATION, HOMING}, {ASSIGNED, AMPLIFIER, TRIGGER})
    closed.sim.wait(3.0)
    assert words(closed, "#3?") == ({ACTIVATED, STILL, INTEGRATION}, {ASSIGNED, AMPLIFIER, HOMED, ARRIVED})


def test_following_error_warning_comes_at_ix12_and_the_trip_at_ix11(closed: Bench) -> None:
    closed.client.request("I111=0 I112=160 I119=0 I120=1 I121=0 I122=500 #1J+")
    closed.sim.wait(0.05)
    first, second = words(closed, "#1?")
    assert WARNING in second
    assert FATAL not in second
    assert words(closed, "??")[1] == {SYSTEM_WARNING}
    closed.client.request("I111=160")
    closed.sim.wait(0.02)
    first, second = words(closed, "#1?")
    assert OPEN_LOOP in first
    assert second == {ASSIGNED, FATAL, WARNING}
    assert words(closed, "??")[1] == {SYSTEM_FATAL, SYSTEM_WARNING}


def test_a_motor_is_in_position_within_ix28_sixteenths(closed: Bench) -> None:
    closed.sim.wait(0.1)
    closed.sim.controller.motors[3].desired += 2.0
    closed.client.request("I328=33")
    assert ARRIVED in words(closed, "#3?")[1]
    closed.sim.controller.motors[3].actual -= 2.0
    closed.sim.controller.motors[3].axis.rebase(2.0)
    closed.client.request("I328=0")
    assert ARRIVED not in words(closed, "#3?")[1]


def test_a_coordinate_system_at_rest_open_and_closed(bench: Bench) -> None:
    assert words(bench, "??") == (set(AT_FIRST), set())
    bench.lathe.enable()
    bench.sim.wait(0.1)
    assert words(bench, "??") == (set(AT_FIRST), {SYSTEM_ARRIVED})
    assert words(bench, "&5??") == (set(AT_FIRST), set())


def test_a_running_coordinate_system_tells_its_modes(closed: Bench) -> None:
    closed.program("INC(X,Z)", "TA10 TS0 TM200", "X100", "X100", "X100", "X100")
    closed.client.request("R")
    closed.sim.wait(0.1)
    first, second = words(closed, "??")
    assert {*AT_FIRST, X_INC, Z_INC, BY_TIME, RUNNING} <= first
    assert Y_INC not in first
    assert second == set()
    closed.settle()
    assert words(closed, "??") == ({*AT_FIRST, X_INC, Z_INC, BY_TIME}, {SYSTEM_ARRIVED})


def test_a_later_feedrate_clears_the_move_time_bit(closed: Bench) -> None:
    closed.program("TM200 F1000 X100")
    closed.client.request("R")
    closed.settle()
    assert BY_TIME not in words(closed, "??")[0]


def test_pvt_mode_has_its_two_bits(closed: Bench) -> None:
    closed.program("ABS", "PVT100", "X100:0")
    closed.client.request("R")
    closed.settle()
    assert words(closed, "??")[1] == {SYSTEM_ARRIVED, SPLINE_OR_PVT, RAPID}


def test_a_motor_in_a_program_is_not_in_position_until_the_end(closed: Bench) -> None:
    closed.sim.wait(0.2)
    closed.program("DWELL200")
    closed.client.request("R")
    closed.sim.wait(0.1)
    first, second = words(closed, "#1?")
    assert TIMER in first
    assert ARRIVED not in second
    closed.settle()
    assert ARRIVED in words(closed, "#1?")[1]


def test_a_run_time_error_is_told_until_the_next_run(closed: Bench) -> None:
    closed.program("P(0-1)=1")
    closed.client.request("R")
    closed.sim.wait(0.1)
    assert RUNTIME_ERROR in words(closed, "??")[1]
    assert closed.lathe.snapshot().faults == ("program: runtime_error",)
    closed.program("X0")
    closed.client.request("R")
    closed.settle()
    assert RUNTIME_ERROR not in words(closed, "??")[1]


def test_the_global_status_tells_an_open_buffer(bench: Bench) -> None:
    assert words(bench, "???") == ({0}, set())
    bench.client.request("OPEN PROG 1")
    assert words(bench, "???") == ({0}, {19})


@pytest.mark.parametrize("table", [PMAC.motor_bits, PMAC.system_bits, PMAC.global_bits])
def test_every_bit_is_one_bit_and_survives_the_way_to_the_host(table: dict[str, tuple[int, int]]) -> None:
    assert len(set(table.values())) == len(table)
    for name in table:
        assert decode(digits_of(pack({name: True}, table)), table) == {name}
    assert decode(digits_of(pack(dict.fromkeys(table, True), table)), table) == set(table)


@pytest.mark.parametrize("digits", ["", "81200080440", "812000", "81200080440G", "8120008044010"])
def test_what_is_no_status_is_refused(digits: str) -> None:
    with pytest.raises(ValueError, match=r".*"):
        decode(digits, PMAC.motor_bits)


def test_a_reset_keeps_the_settings_of_the_machine_and_forgets_where_it_stands(closed: Bench) -> None:
    closed.lathe.home()
    closed.program("INC", "X5", "RETURN")
    closed.client.request("#1J=3000")
    closed.settle()
    closed.client.request("I116=3 #1->7X")
    assert closed.number("#1P") == pytest.approx(3000, abs=10)
    closed.raw("$$$\r")
    closed.lathe.connect()
    assert closed.number("I116") == 500
    assert closed.ask("#1->") == "X"
    assert closed.client.request("LIST PROG 1") == ("INC", "X5", "RET")
    snapshot = closed.lathe.snapshot()
    assert not snapshot.loops_closed
    assert not snapshot.homed
    assert closed.lathe.verify() == ()
    assert closed.client.numbers("#1P", "#2P", "#3P") == pytest.approx((0, 0, 0), abs=20)
    closed.client.request("#1HM")
    closed.sim.wait(2.0)
    true_position = closed.sim.controller.motors[1]
    assert true_position.axis.origin == pytest.approx(0, abs=1), "the iron stood where it was"


def test_a_factory_reset_leaves_factory_settings_no_axes_and_no_programs(closed: Bench) -> None:
    closed.program("X5")
    closed.raw("$$$***\r")
    closed.lathe.connect()
    factory = {"I10": 3713707, "I116": 32, "I117": 0.015625, "I115": 0.25, "I130": 2000, "I169": 20480, "I188": 50}
    assert closed.client.numbers(*factory) == tuple(factory.values())
    assert [closed.ask(f"#{motor}->") for motor in (1, 2, 3)] == ["0", "0", "0"]
    assert closed.raw("LIST PROG 1\r") == b"\x07ERR003\r"
    assert any(problem.key == "I116" for problem in closed.lathe.verify())
