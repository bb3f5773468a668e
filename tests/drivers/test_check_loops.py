"""Loops that nothing in a program ends: found, watched, and left as a host would leave them."""

from __future__ import annotations

import pytest

from drivers.pmac.analysis.endless import find_loops
from drivers.pmac.analysis.walk import Ending, Walk, walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.program_text import read_program

SETTINGS = {187: 20.0, 188: 10.0, 189: 1000.0, 190: 1000.0, 8: 2.0, 10: 3_713_707.0}


def walked(lines: str, turn: float | None = None, before: str = "") -> Walk:
    text = read_program(f"{before}\nOPEN PROG 1\nCLEAR\nINC TA20 TS10 TM20\n{lines}\nCLOSE")
    definitions = read_definitions(["#1->X", "#2->Y"])
    turns = {} if turn is None else {2: turn}
    return walk(text, SETTINGS, definitions, {1: 0.0, 2: 0.0}, counts_per_turn=turns)


def flags(found: Walk) -> list[dict[str, float]]:
    return [{f"{kind}{index}": value for (kind, index), value in left.flags.items()} for left in found.left]


def moves_of(found: Walk) -> list[int]:
    return [step.line for step in found.steps if step.planned.record is not None]


def test_a_flag_that_nobody_sets_is_set_and_the_end_is_seen() -> None:
    found = walked("M26=0\nWHILE(M26=0)\nX10\nX-10\nENDW\nX-500")
    assert found.ending is Ending.FINISHED
    assert flags(found) == [{"M26": 1.0}]
    assert found.left[0].circle.period == 2
    assert moves_of(found)[-1] == 6
    assert found.steps[-1].at[0] == -500


@pytest.mark.parametrize(
    ("condition", "flag"),
    [
        ("M26!=1", {"M26": 1.0}),
        ("P5!>3", {"P5": 4.0}),
        ("P5<7", {"P5": 8.0}),
        ("M1=0 OR M2=0", {"M1": 1.0, "M2": 1.0}),
        ("M1=0 AND M2=0", {"M1": 1.0}),
        ("Q7~2", {"Q7": 1.0}),
    ],
)
def test_the_flag_that_ends_a_condition_is_found(condition: str, flag: dict[str, float]) -> None:
    found = walked(f"Q7=2\nWHILE({condition})\nX10 X-10\nENDW\nX5")
    assert found.ending is Ending.FINISHED
    assert flags(found) == [flag]


def test_the_motion_is_watched_for_some_turns_of_the_spindle() -> None:
    """A pass makes 1000 counts of a turn of 10000: three turns are 30 passes at least."""
    found = walked("WHILE(M26=0)\nX10 Y500\nX-10 Y500\nENDW", turn=10_000.0)
    left = found.left[0]
    assert left.circle.passes >= 30
    assert left.circle.passes < 40
    assert found.steps[-1].at[1] > 30_000


def test_a_loop_that_counts_is_no_endless_one() -> None:
    found = walked("WHILE(P1<50)\nP1=P1+1\nX10\nX-10\nENDW")
    assert found.left == ()
    assert len(moves_of(found)) == 100


def test_a_loop_whose_flag_is_set_inside_ends_by_itself() -> None:
    found = walked("WHILE(M26=0)\nP1=P1+1\nIF(P1=20) M26=1\nX10\nX-10\nENDW")
    assert found.left == ()
    assert len(moves_of(found)) == 40


def test_a_count_that_has_nothing_to_do_with_the_end_does_not_hide_it() -> None:
    found = walked("WHILE(M26=0)\nP1=P1+1\nX10\nX-10\nENDW")
    assert flags(found) == [{"M26": 1.0}]


def test_a_motion_that_grows_for_ever_is_left_too() -> None:
    found = walked("WHILE(M26=0)\nP1=P1+1\nX(P1)\nX(-P1)\nENDW")
    assert found.left[0].circle.period is None
    assert found.ending is Ending.FINISHED


def test_a_wait_for_an_input_is_such_a_loop() -> None:
    found = walked("WHILE(M1=0) WAIT\nX10")
    assert flags(found) == [{"M1": 1.0}]
    assert moves_of(found) == [2]


@pytest.mark.parametrize("body", ["", "P2=1\n", "P2=P2+1\n", "IF(P2=3)\nP4=1\nENDIF\n"])
def test_a_wait_of_several_lines_is_the_same_wait(body: str) -> None:
    found = walked(f"LINEAR\nP3=1\nWHILE(M1=0)\n{body}ENDWHILE\nX10")
    assert flags(found) == [{"M1": 1.0}]
    assert found.steps[-1].at[0] == pytest.approx(10)


def test_without_a_flag_the_program_is_stopped_there() -> None:
    found = walked("WHILE(1=1)\nX10\nX-10\nENDW\nX500")
    assert found.ending is Ending.ENDLESS
    assert flags(found) == [{}]
    assert 500 not in {step.at[0] for step in found.steps}


def test_a_circle_of_goto_has_no_flag() -> None:
    found = walked("N10\nX10\nX-10\nGOTO10")
    assert found.ending is Ending.ENDLESS
    assert found.left[0].circle.loop is None


def test_a_goto_that_leads_out_ends_a_loop() -> None:
    found = walked("WHILE(M26=0)\nP1=P1+1\nX10\nX-10\nIF(P1=30) GOTO99\nENDW\nN99 X7")
    assert found.left == ()
    assert len(moves_of(found)) == 61


def test_a_flag_that_is_put_back_is_not_set_for_ever() -> None:
    found = walked("WHILE(M26=0)\nX10\nX-10\nM26=0\nENDW")
    assert found.ending is Ending.ENDLESS
    assert [bool(each) for each in flags(found)] == [True, False]


def test_two_loops_inside_each_other_are_left_one_after_the_other() -> None:
    found = walked("WHILE(M1=0)\nX5\nWHILE(M2=0)\nX10\nX-10\nENDW\nENDW\nX7")
    assert found.ending is Ending.FINISHED
    assert flags(found) == [{"M2": 1.0}, {"M1": 1.0}]


def test_a_loop_that_ends_inside_one_that_does_not_is_run_whole() -> None:
    found = walked("WHILE(M26=0)\nP2=0\nWHILE(P2<20)\nP2=P2+1\nX10\nX-10\nENDW\nX100\nENDW")
    assert flags(found) == [{"M26": 1.0}]
    assert found.left[0].circle.period == 41


def test_the_same_subroutine_twice_is_no_circle() -> None:
    found = walked("GOSUB100\n" * 6 + "RETURN\nN100 X10 X-10\nRETURN")
    assert found.left == ()
    assert len(moves_of(found)) == 12


def test_many_moves_in_a_line_are_no_circle() -> None:
    found = walked("X10 " * 30 + "\nX7")
    assert found.left == ()
    assert len(moves_of(found)) == 31


def test_two_moves_in_a_line_of_a_loop_are_one_pass() -> None:
    found = walked("WHILE(M26=0)\nX10 X-10\nENDW")
    assert found.left[0].circle.period == 2


def test_a_circle_through_a_subroutine_is_found() -> None:
    found = walked("N5 GOSUB100\nGOTO5\nRETURN\nN100 X10 X-10\nRETURN")
    assert found.ending is Ending.ENDLESS


def test_an_endless_loop_that_calls_a_program_is_left() -> None:
    text = read_program(
        "OPEN PROG 1\nINC TA20 TS10 TM20\nWHILE(M26=0)\nX100\nCALL500\nX-133\nENDW\nX7\nCLOSE\n"
        "OPEN PROG 500\nX33\nRETURN\nCLOSE"
    )
    found = walk(text, SETTINGS, read_definitions(["#1->X"]), {1: 0.0})
    assert found.ending is Ending.FINISHED
    assert found.left[0].circle.period == 3


@pytest.mark.parametrize("called", ["GOSUB100", "CALL500"])
def test_an_endless_loop_may_move_in_what_it_calls_alone(called: str) -> None:
    text = read_program(
        f"OPEN PROG 1\nINC TA20 TS10 TM20\nWHILE(M26=0)\n{called}\nENDW\nX7\nRETURN\nN100 X100 X-100\nRETURN\n"
        "CLOSE\nOPEN PROG 500\nX33 X-33\nRETURN\nCLOSE"
    )
    found = walk(text, SETTINGS, read_definitions(["#1->X"]), {1: 0.0})
    assert found.ending is Ending.FINISHED
    assert flags(found) == [{"M26": 1.0}]


def test_a_flag_that_a_subroutine_sets_is_not_taken_for_free() -> None:
    text = read_program("OPEN PROG 1\nWHILE(M26=0)\nGOSUB100\nENDW\nRETURN\nN100 M26=1\nRETURN\nN200 P1=1\nCLOSE")
    (loop,) = find_loops(text.program)
    assert not loop.endless


def test_a_program_that_is_too_long_is_looked_at_so_far() -> None:
    text = read_program("OPEN PROG 1\nINC TA20 TS10 TM20\nWHILE(P1<1000)\nP1=P1+1\nX1\nENDW\nCLOSE")
    found = walk(text, SETTINGS, read_definitions(["#1->X"]), {1: 0.0}, most_steps=50)
    assert found.ending is Ending.TOO_LONG
    assert found.steps[-1].at[0] == pytest.approx(50)
