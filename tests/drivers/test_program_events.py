"""What a program does besides moving: HOME, PSET, synchronous assignments, calls and words for others."""

from __future__ import annotations

import pytest

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.plcs.plc import Addressed
from drivers.simulator.card.coordinate import CoordinateSystem
from tests.drivers.ideal_card import CYCLE_MS, IdealCard, refused


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(request: pytest.FixtureRequest) -> IdealCard:
    dialect: Dialect = request.param
    return IdealCard(dialect)


def test_home_waits_until_every_motor_is_home_and_the_program_goes_on_from_there(card: IdealCard) -> None:
    """The triggers are 500 counts behind the motors; at 5 counts/ms that takes 100 ms."""
    card.program("ABS", "TA20 TS0 TM100", "X300", "HOME1..2", "P1=1", "X200 Y0")
    card.set(I123=-5, I223=-5)
    card.system.run()
    card.wait(200)
    assert card.motor(1).jog.homes and card.motor(1).jog.stage
    assert card.get("P1") == 0
    assert card.system.running
    card.settle()
    assert card.motor(1).home_complete and card.motor(2).home_complete
    assert card.get("P1") == 1
    assert card.x == 200, "from the new zero"
    assert card.motor(1).axis.origin == pytest.approx(0), "which is where the trigger is"


def test_homez_declares_home_without_a_move(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X300", "HOMEZ1", "X0", "P1=1")
    assert card.motor().home_complete
    assert card.x == 0
    assert card.motor().axis.origin == 500 + 300, "where the motor stood at power-up, and how far it went"
    assert card.get("P1") == 1


@pytest.mark.parametrize("motor", [7, 32])
def test_a_home_that_cannot_be_is_a_run_time_error(card: IdealCard, motor: int) -> None:
    card.program(f"HOME{motor}", "X1000")
    card.system.run()
    card.settle()
    assert card.system.motion.runtime_error
    assert card.x == 0


def test_a_home_of_a_motor_that_another_program_moves_is_a_run_time_error(card: IdealCard) -> None:
    card.controller.define_axis(1, 2, None)
    card.controller.define_axis(2, 2, read_definitions(["#2->X"])[0])
    card.store("INC", "TA20 TS0 TM1000", "X5000", number=2)
    card.controller.systems[2].point(2)
    card.program("HOME2")
    card.controller.each_system(CoordinateSystem.run)
    card.wait(100)
    assert card.system.motion.runtime_error
    card.settle()
    assert card.motor(2).desired == pytest.approx(5000), "the other program goes on"


def test_a_home_search_that_is_killed_ends_the_program(card: IdealCard) -> None:
    card.program("HOME1", "X1000")
    card.system.run()
    card.wait(20)
    assert card.motor().jog.homes and card.motor().jog.stage
    card.motor().kill()
    card.wait(20)
    assert card.system.motion.runtime_error
    assert not card.system.running


def test_pset_changes_where_the_axes_are_and_moves_nothing(card: IdealCard) -> None:
    track = card.run("ABS", "TA20 TS0 TM100", "X1000", "PSET X50 Y7", "X80", "INC", "X5")
    assert track[-1] == pytest.approx(1035)
    assert card.motor().position == 85, "what is reported is counted from the new zero"
    assert card.motor(2).position == 7
    assert card.motor(2).desired == 0


def test_an_axis_may_be_redefined_from_outside(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X1000 Y500")
    card.system.set_axis("X", 5)
    card.run("X6")
    assert card.x == pytest.approx(1001)
    card.system.zero_axes()
    assert card.system.frame.positions() == {"X": 0, "Y": 0}
    assert card.motor(2).position == 0
    card.system.set_axis("X", 0.0)
    assert refused(lambda: card.system.set_axis("Z", 1)) == 3


def test_a_jog_goes_to_what_is_reported(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X1000", "PSET X0")
    card.motor().jog_to(30)
    card.settle()
    assert (card.motor().position, card.x) == (30, 1030)


def test_the_axes_are_not_redefined_while_a_program_runs(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM1000", "X1000")
    card.system.run()
    card.wait(50)
    for act in (
        lambda: card.system.set_axis("X", 1),
        card.system.zero_axes,
        card.system.match_positions,
    ):
        assert refused(act) == 1


def test_a_definition_begins_to_count_anew(card: IdealCard) -> None:
    card.run("ABS", "TA20 TS0 TM100", "X1000", "PSET X0")
    definition = card.system.frame.definitions[1]
    card.controller.define_axis(1, 1, definition)
    assert card.motor().position == 1000
    assert card.system.frame.positions()["X"] == 1000


def test_a_synchronous_assignment_waits_for_the_start_of_its_move(card: IdealCard) -> None:
    """M1=1 is done when its line is calculated, when the move before it begins; M2==1 when its own move begins."""
    card.program("INC", "TA20 TS0 TM300", "X3000", "M1=1 M2==1", "X3000", "DWELL0")
    card.system.run()
    seen: dict[str, float] = {}
    while card.system.moving:
        card.block()
        for name in ("M1", "M2"):
            if card.get(name) and name not in seen:
                seen[name] = card.x
    one_block = 11 * CYCLE_MS * 10
    assert seen["M1"] < 2 * one_block
    # The ramp into the second move begins half of TA before the boundary; it is a ramp between equal speeds.
    assert seen["M2"] == pytest.approx(3000 - 10 * 10, abs=one_block)


def test_calls_reach_the_other_programs_of_the_card(card: IdealCard) -> None:
    card.store("INC", "X1000", "RETURN", number=500)
    card.store("N1000", "X(Q101)", "RETURN", number=1000)
    card.program("INC TA20 TS0 TM100", "CALL 500", "X1")
    card.system.run()
    card.settle()
    assert card.x == pytest.approx(1001)


def test_a_called_program_that_is_not_well_formed_is_a_run_time_error(card: IdealCard) -> None:
    card.store("WHILE(P1=0)", "X1000", number=500)
    card.program("INC TA20 TS0 TM100", "X10", "CALL 500", "X1")
    card.system.run()
    card.settle()
    assert card.system.motion.runtime_error
    assert card.x == 10


def test_what_a_program_says_waits_for_the_ports(card: IdealCard) -> None:
    card.run('SEND"READY"', 'CMD"#2J+"', "ENABLE PLC 1,3", "DISABLE PLC 1")
    assert [text for text, _ in card.controller.host.host_messages] == ["READY"]
    assert list(card.controller.host.pending_commands) == [("#2J+", "", Addressed(motor=1, system=1))]
    assert card.controller.plcs.switches.enabled == {3}
    card.controller.reset()
    assert not card.controller.host.host_messages
    assert not card.controller.host.pending_commands
