"""Which line comes next: loops, branches, labels, jumps and subroutines, as they are executed."""

from __future__ import annotations

import time

import pytest

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.requests import BlendBreak, DwellRequest, Finished, Halt, LinearRequest
from tests.drivers.language.runs import Bench, requests_of, targets


def refusal(text: str) -> PmacError:
    with pytest.raises(PmacError) as refused:
        Bench().run(text)
    return refused.value


def test_while_runs_until_its_condition_is_false_and_endw_ends_it() -> None:
    assert targets(Bench().run("WHILE(P1<3)\nP1=P1+1\nX(P1)\nENDW\nX9")) == [1, 2, 3, 9]


def test_a_single_line_while_needs_no_endwhile() -> None:
    bench = Bench()
    assert targets(bench.run("WHILE(P1<3) P1=P1+1 X(P1)\nX9")) == [1, 2, 3, 9]


def test_while_wait_holds_the_program_in_its_place() -> None:
    bench = Bench()
    run = bench.start("WHILE(P1=0) WAIT\nX5")
    assert [run.advance() for _ in range(5)] == [BlendBreak()] * 5
    bench.store.set(VariableKind.P, 1, 1.0)
    assert targets(requests_of(run)) == [5]


@pytest.mark.parametrize(("flag", "way"), [(1, [1, 3]), (0, [2, 3])])
def test_if_else_endif(flag: float, way: list[float]) -> None:
    assert targets(Bench(M11=flag).run("IF(M11=1)\nX1\nELSE\nX2\nENDIF\nX3")) == way
    assert targets(Bench(M11=flag).run("IF(M11=1) X1\nELSE X2\nX3")) == way
    assert targets(Bench(M11=flag).run("IF(M11=1)\nX1\nELSE\nX2\nENDI\nX3")) == way


def test_an_else_on_the_next_line_belongs_to_the_single_line_if() -> None:
    assert targets(Bench(P1=1).run("IF(P1=1) X1\nELSE\nX2\nX3\nENDIF\nX4")) == [1, 4]


def test_case_and_spaces_do_not_matter_as_in_programs_of_others() -> None:
    text = "While(P1 = 0 and P2 = 0)\nGoSub101\nEnd While\nReturn\nN101 x10 P1=1\nret"
    assert targets(Bench().run(text)) == [10]


@pytest.mark.parametrize("text", ["IF(P1<=1) X1", "IF(P1>=1) X1", "WHILE(P1)\nENDW", "IF((P1=0) AND (P2=0)) X1"])
def test_a_condition_has_one_of_the_comparators_and_no_parentheses_of_its_own(text: str) -> None:
    assert refusal(text).code == 3


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("1=1", True),
        ("1!=1", False),
        ("2>1", True),
        ("2!>2", True),
        ("1<2", True),
        ("1!<2", False),
        ("1~1.9", True),
        ("1~2", False),
        ("1!~2", True),
        ("1=1 OR 1=2 AND 1=3", True),
        ("1=2 AND 1=1 OR 1=1", True),
    ],
)
def test_comparators_and_that_and_binds_tighter_than_or(condition: str, holds: bool) -> None:
    assert targets(Bench().run(f"IF({condition}) X1\nX2")) == ([1, 2] if holds else [2])


def test_goto_goes_to_a_label_forwards_and_backwards() -> None:
    assert targets(Bench().run("GOTO20\nX1\nN10 X2\nGOTO30\nN20 X3\nGOTO10\nN30 X4")) == [3, 2, 4]


def test_goto_with_a_computed_label_is_a_case_statement() -> None:
    text = "GOTO(10*P1)\nN10 X1\nRETURN\nN20 X2\nRETURN\nN30 X3"
    assert [targets(Bench(P1=n).run(text)) for n in (1, 2, 3)] == [[1], [2], [3]]


@pytest.mark.parametrize("text", ["GOTO99", "GOSUB99", "GOTO(P1-5)", "GOTO9.6\nN9 X1"])
def test_a_jump_to_a_label_that_is_not_there_is_a_run_time_error(text: str) -> None:
    assert "does not exist" in refusal(text).detail


def test_a_program_begins_with_an_implicit_n0() -> None:
    text = "P1=P1+1 X(P1)\nIF(P1<3) GOTO0"
    assert targets(Bench().run(text)) == [1, 2, 3]


def test_labels_go_from_0_to_262143_and_o_is_one_too() -> None:
    assert targets(Bench().run("GOTO262143\nX1\nN262143 X2")) == [2]
    assert targets(Bench().run("GOTO0\nX1\nO0 X2")) == [2]
    assert refusal("N262144").code == 3


def test_the_first_of_two_equal_labels_counts() -> None:
    assert targets(Bench().run("GOTO5\nN5 X1\nRETURN\nN5 X2")) == [1]


def test_gosub_comes_back_behind_itself_and_ret_is_return() -> None:
    text = "GOSUB100 X1\nGOSUB(P1+200)\nX2\nRETURN\nN100 X10 RET\nN200 X20\nRETURN"
    assert targets(Bench().run(text)) == [10, 1, 20, 2]


def test_return_in_the_first_program_and_its_end_finish_it() -> None:
    run = Bench().start("X1\nRETURN\nX2")
    assert isinstance(run.advance(), LinearRequest)
    assert run.advance() == run.advance() == Finished()


def test_the_end_of_the_program_returns_from_a_subroutine() -> None:
    assert targets(Bench().run("GOSUB10 X1 RETURN\nN10 X5")) == [5, 1]


def test_gosub_and_call_are_nested_15_deep() -> None:
    levels = "\n".join(f"N{n} GOSUB{n + 1}\nRETURN" for n in range(1, 16))
    assert Bench().run(f"GOSUB1 X1 RETURN\n{levels.replace('GOSUB16', 'P1=15')}") != []
    assert "15" in refusal(f"GOSUB1\nRETURN\n{levels}\nN16 RETURN").detail


def test_a_subroutine_that_calls_itself_is_an_error() -> None:
    assert "15" in refusal("N1 P1=P1+1 GOSUB1").detail


def test_while_loops_and_gosubs_do_not_disturb_each_other() -> None:
    text = "WHILE(P1<2)\nP1=P1+1\nGOSUB10\nENDW\nRETURN\nN10 P2=0\nWHILE(P2<2) P2=P2+1 X(10*P1+P2)\nRETURN"
    assert targets(Bench().run(text)) == [11, 12, 21, 22]


def test_two_backward_jumps_break_the_blending_and_goto_counts_as_endwhile_does() -> None:
    text = "N1 P1=P1+1\nIF(P1<5) GOTO1\nX1"
    run = Bench().start(text)
    looks = [run.advance() for _ in range(3)]
    assert [type(look) for look in looks] == [BlendBreak, BlendBreak, LinearRequest]


def test_forward_jumps_gosub_call_and_return_do_not_break_the_blending() -> None:
    bench = Bench()
    bench.programs[7] = "P3=P3+1\nRETURN"
    subroutines = "GOSUB10 GOSUB10 GOSUB10 CALL7 CALL7 CALL7"
    run = bench.start(f"{subroutines} GOTO5\nN5 X1 RETURN\nN10 P2=P2+1 RETURN")
    assert isinstance(run.advance(), LinearRequest)
    assert (bench.value("P2"), bench.value("P3")) == (3, 3)


@pytest.mark.parametrize(
    "text",
    [
        "N1 GOTO1",
        "WHILE(1=1)\nENDWHILE",
        "WHILE(1=1) WAIT",
        "WHILE(1=1)\nGOSUB5\nENDW\nN5 RETURN",
        "N1\nGOSUB5\nGOTO1\nN5 P1=P1+1 RETURN",
        "WHILE(1=1)\nM1==1\nENDW",
    ],
)
def test_a_loop_without_moves_gives_the_time_back_again_and_again(text: str) -> None:
    run = Bench().start(text)
    assert {type(run.advance()) for _ in range(200)} == {BlendBreak}


def test_subroutines_that_call_each_other_without_end_give_the_time_back() -> None:
    """Three calls in each of 14 levels are 3^14 = 4.8 million calls: too many for one look."""
    levels = "\n".join(f"N{n} " + f"GOSUB{n + 1} " * 3 + "RETURN" for n in range(1, 15))
    run = Bench().start(f"GOSUB1 RETURN\n{levels}\nN15 P1=P1+1 RETURN")
    started = time.process_time()
    assert run.advance() == BlendBreak()
    assert time.process_time() - started < 1.0


def test_stop_halts_and_the_next_line_comes_when_it_goes_on() -> None:
    run = Bench().start("X1\nSTOP\nX2")
    assert isinstance(run.advance(), LinearRequest)
    assert run.advance() == Halt()
    assert targets([run.advance()]) == [2]


def test_blockstart_and_blockstop_say_what_is_one_step() -> None:
    run = Bench().start("X1\nBLOCKSTART\nX2\nX3\nBSTOP\nX4\nBSTART X5 BLOCKSTOP")
    inside = []
    for _ in range(5):
        run.advance()
        inside.append(run.in_block)
    assert inside == [False, True, True, False, True]


def test_the_line_is_that_of_the_request_and_program_0_is_the_first_one() -> None:
    bench = Bench()
    bench.programs[40] = "\nX2\nRETURN"
    run = bench.start("X1\n\nCALL40 X3")
    seen = []
    for _ in range(3):
        run.advance()
        seen.append((run.program, run.line))
    assert seen == [(0, 0), (40, 1), (0, 2)]


def test_a_program_begins_at_a_label() -> None:
    bench = Bench()
    assert targets(requests_of(bench.start("X1\nN100 X2", label=100))) == [2]
    assert targets(requests_of(bench.start("X1\nN100 X2", label=0))) == [1, 2]
    with pytest.raises(PmacError) as refused:
        bench.start("X1", label=7)
    assert refused.value.code == 15


def test_dwell_and_delay_are_never_negative() -> None:
    dwell, delay = Bench().run("DWELL(P1-5)\nDELAY-3")
    assert isinstance(dwell, DwellRequest) and dwell.duration_ms == 0.0
    assert isinstance(delay, LinearRequest) and delay.tm_ms == 0.0


def test_angles_are_degrees_or_radians_as_i15_says_when_the_program_starts() -> None:
    text = "I15=1-I15\nX(100*SIN(90))"
    assert targets(Bench().run(text)) == [pytest.approx(100)]
    assert targets(Bench(I15=1).run(text)) == [pytest.approx(89.39966636)]


def test_illegal_arithmetic_is_an_error_for_a_checker_only() -> None:
    assert targets(requests_of(Bench().start("X(5/(P1-P1))", strict=False))) == [2**47]
    assert refusal("X(5/(P1-P1))").code == 3
