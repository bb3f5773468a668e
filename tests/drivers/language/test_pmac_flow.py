"""Which line comes next: loops, branches, labels, jumps, subroutines, and calls of other programs."""

from __future__ import annotations

import time

import pytest

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import READABLE
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.requests import (
    BlendBreak,
    CircleRequest,
    DwellRequest,
    EndOfProgram,
    Halt,
    LinearRequest,
    RapidRequest,
)
from tests.drivers.language.trees import Bench, requests_of, targets


def refusal(text: str) -> PmacError:
    with pytest.raises(PmacError) as refused:
        Bench().run(text)
    return refused.value


def test_while_runs_until_its_condition_is_false() -> None:
    assert targets(Bench().run("WHILE(P1<3)\nP1=P1+1\nX(P1)\nENDW\nX9")) == [1, 2, 3, 9]
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


def test_a_single_line_if_takes_the_else_below_it_whatever_its_case_and_spaces() -> None:
    assert targets(Bench(P1=1).run("IF(P1=1) X1\nELSE\nX2\nX3\nENDIF\nX4")) == [1, 4]
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


def test_goto_goes_to_the_first_label_of_its_number_or_to_the_implicit_n0() -> None:
    assert targets(Bench().run("GOTO20\nX1\nN10 X2\nGOTO30\nN20 X3\nGOTO10\nN30 X4")) == [3, 2, 4]
    text = "GOTO(10*P1)\nN10 X1\nRETURN\nN20 X2\nRETURN\nN30 X3"
    assert [targets(Bench(P1=n).run(text)) for n in (1, 2, 3)] == [[1], [2], [3]]
    text = "P1=P1+1 X(P1)\nIF(P1<3) GOTO0"
    assert targets(Bench().run(text)) == [1, 2, 3]
    assert targets(Bench().run("GOTO262143\nX1\nN262143 X2")) == [2]
    assert targets(Bench().run("GOTO0\nX1\nO0 X2")) == [2]
    assert refusal("N262144").code == 3
    assert targets(Bench().run("GOTO5\nN5 X1\nRETURN\nN5 X2")) == [1]


@pytest.mark.parametrize("text", ["GOTO99", "GOSUB99", "GOTO(P1-5)", "GOTO9.6\nN9 X1"])
def test_a_jump_to_a_label_that_is_not_there_is_a_run_time_error(text: str) -> None:
    assert "does not exist" in refusal(text).detail


def test_gosub_comes_back_and_return_or_the_end_finish_what_they_are_in() -> None:
    text = "GOSUB100 X1\nGOSUB(P1+200)\nX2\nRETURN\nN100 X10 RET\nN200 X20\nRETURN"
    assert targets(Bench().run(text)) == [10, 1, 20, 2]
    run = Bench().start("X1\nRETURN\nX2")
    assert isinstance(run.advance(), LinearRequest)
    assert run.advance() == run.advance() == EndOfProgram()
    assert targets(Bench().run("GOSUB10 X1 RETURN\nN10 X5")) == [5, 1]


def test_subroutines_nest_15_deep_beside_loops() -> None:
    levels = "\n".join(f"N{n} GOSUB{n + 1}\nRETURN" for n in range(1, 16))
    assert Bench().run(f"GOSUB1 X1 RETURN\n{levels.replace('GOSUB16', 'P1=15')}") != []
    assert "15" in refusal(f"GOSUB1\nRETURN\n{levels}\nN16 RETURN").detail
    assert "15" in refusal("N1 P1=P1+1 GOSUB1").detail
    text = "WHILE(P1<2)\nP1=P1+1\nGOSUB10\nENDW\nRETURN\nN10 P2=0\nWHILE(P2<2) P2=P2+1 X(10*P1+P2)\nRETURN"
    assert targets(Bench().run(text)) == [11, 12, 21, 22]


def test_backward_jumps_break_the_blending_and_forward_jumps_and_calls_do_not() -> None:
    text = "N1 P1=P1+1\nIF(P1<5) GOTO1\nX1"
    run = Bench().start(text)
    looks = [run.advance() for _ in range(3)]
    assert [type(look) for look in looks] == [BlendBreak, BlendBreak, LinearRequest]
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


def test_stop_halts_and_blockstart_and_blockstop_say_what_is_one_step() -> None:
    run = Bench().start("X1\nSTOP\nX2")
    assert isinstance(run.advance(), LinearRequest)
    assert run.advance() == Halt()
    assert targets([run.advance()]) == [2]
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


def test_waits_are_never_negative_and_arithmetic_fails_for_a_checker_only() -> None:
    dwell, delay = Bench().run("DWELL(P1-5)\nDELAY-3")
    assert isinstance(dwell, DwellRequest) and dwell.duration_ms == 0.0
    assert isinstance(delay, LinearRequest) and delay.tm_ms == 0.0
    assert targets(requests_of(Bench().start("X(5/(P1-P1))", strict=False))) == [2**47]
    assert refusal("X(5/(P1-P1))").code == 3


def test_angles_are_degrees_or_radians_as_i15_says_when_the_program_starts() -> None:
    text = "I15=1-I15\nX(100*SIN(90))"
    assert targets(Bench().run(text)) == [pytest.approx(100)]
    assert targets(Bench(I15=1).run(text)) == [pytest.approx(89.39966636)]


# Calls of other programs: CALL, G, M, T and D codes, and the arguments that READ takes from the calling line.

G_CODES = """\
N0 RAPID RETURN
N1000 LINEAR RETURN
N2000 CIRCLE1 RETURN
N3000 CIRCLE2 RETURN
N4000 READ(P)
IF(Q100&32768>0) DWELL(Q116)
RETURN
N17000 NORMAL K-1 RETURN
N90000 ABS RETURN
N91000 INC RETURN
N92000 READ(X,Y,Z)
IF(Q100&8388608>0) PSET X(Q124)
RETURN
N96000 READ(S) RETURN"""


def machine_tool() -> Bench:
    bench = Bench()
    bench.programs = {1000: G_CODES, 1001: "N3000 M11==1\nRETURN\nN5000 M11==0\nRETURN"}
    bench.modes.by_move_time = True
    return bench


def refusal_in_call(bench: Bench, text: str) -> str:
    with pytest.raises(PmacError) as refused:
        bench.run(text)
    return refused.value.detail


def test_call_runs_another_program_or_label_and_comes_back_behind_itself() -> None:
    bench = Bench()
    bench.programs[500] = "X1\nX2\nRETURN\nX3"
    assert targets(bench.run("CALL500 X9\nX10")) == [1, 2, 9, 10]
    # CALL 35.1 is N10000 of program 35, CALL 47.123 N12300 of 47 (Software Reference, CALL).
    bench = Bench()
    bench.programs = {35: "X1 RETURN\nN10000 X2 RETURN", 47: "N12300 X3 RETURN"}
    assert targets(bench.run("CALL 35\nCALL 35.1\nCALL(40+7.123)")) == [1, 2, 3]


@pytest.mark.parametrize("call", ["CALL7", "CALL35.2", "CALL0", "CALL-1", "CALL32768"])
def test_a_call_of_what_is_not_there_is_a_run_time_error(call: str) -> None:
    bench = Bench()
    bench.programs[35] = "X1"
    assert "CALL" in refusal_in_call(bench, call)


def test_a_called_program_without_a_good_structure_is_err016() -> None:
    bench = Bench()
    bench.programs[35] = "WHILE(P1=0)\nX1"
    with pytest.raises(PmacError) as refused:
        bench.run("CALL35")
    assert refused.value.code == 16


@pytest.mark.parametrize(
    ("code", "program", "label"),
    [
        ("G1", 1000, 1000),
        ("G01", 1000, 1000),
        ("G2.5", 1000, 2500),
        ("G117", 1010, 17000),
        ("M01", 1001, 1000),
        ("M12", 1001, 12000),
        ("M115", 1011, 15000),
        ("T5", 1002, 5000),
        ("D7", 1003, 7000),
        ("D999.999", 1093, 99999),
        ("M(P1+2)", 1001, 2000),
    ],
)
def test_codes_call_programs_1000_to_1003_and_the_hundreds_add_ten(code: str, program: int, label: int) -> None:
    """The manual's examples: M01 is N1000 of 1001, M12 N12000, M115 N15000 of 1011."""
    bench = Bench()
    bench.programs[program] = f"X-1 RETURN\nN{label} X5 RETURN"
    assert targets(bench.run(code)) == [5]


@pytest.mark.parametrize("code", ["G1", "M1", "T1", "D1", "G999.999"])
def test_a_code_without_program_or_label_is_ignored_and_its_line_goes_on(code: str) -> None:
    bench = Bench()
    assert targets(bench.run(f"{code} X5 F100\nX6")) == [5, 6]
    bench.programs = dict.fromkeys((1000, 1001, 1002, 1003), "N50000 X1 RETURN")
    assert targets(bench.run(f"{code} X5\nX6")) == [5, 6]


@pytest.mark.parametrize("code", ["G1000", "M-1"])
def test_codes_end_at_999_999(code: str) -> None:
    assert "0 to 999.999" in refusal_in_call(Bench(), code)


def test_m_codes_begin_with_an_implicit_n0_and_m_and_i_without_equals_are_code_and_vector() -> None:
    bench = Bench(M1=7, I100=1)
    bench.programs[1001] = "N1000 X5 RETURN"
    assert targets(bench.run("M1\nI100")) == [5]
    assert (bench.value("M1"), bench.value("I100")) == (7, 1)
    # A program always begins with an implicit N0 (User Manual, M00).
    bench = Bench()
    bench.programs[1001] = "X5\nRET\nN1000 X6\nRET"
    assert targets(bench.run("M00")) == [5]


def test_a_rs274_program_runs_as_it_stands() -> None:
    text = "G17 G90 G0 X10 Y10\nG1 X20 F600\nG2 X30 Y10 I5 J0\nG91 G01 X-5\nM3 G4 P250\nG92 X0\nM30"
    requests = machine_tool().run(text)
    assert [
        type(r).__name__ for r in requests
    ] == "RapidRequest LinearRequest CircleRequest LinearRequest DwellRequest PresetRequest".split()
    rapid, line, arc, back, dwell, _ = requests
    assert isinstance(rapid, RapidRequest) and rapid.targets["Y"] == 10
    assert isinstance(line, LinearRequest) and line.tm_ms == 10 / 600 * 1000
    assert isinstance(arc, CircleRequest) and arc.clockwise and arc.center == {"X": 5, "Y": 0, "Z": 0}
    assert isinstance(back, LinearRequest) and back.targets["X"] == 25
    assert isinstance(dwell, DwellRequest) and dwell.duration_ms == 250
    assert [d.value for d in dwell.deferred] == [1]


def test_read_takes_the_words_of_its_line_in_order_up_to_the_first_other_letter() -> None:
    bench = Bench()
    bench.programs[10] = "READ(X,P)\nRETURN"
    requests = bench.run("CALL10 X5 P7 Y3")
    assert targets(requests, "X") == [0] and targets(requests, "Y") == [3]
    assert (bench.value("Q124"), bench.value("Q116")) == (5, 7)
    bench = Bench()
    bench.programs[10] = "READ(X,Z)\nRETURN"
    requests = bench.run("CALL10 X5 Y6 Z7")
    assert bench.value("Q100") == 2**23
    assert (bench.value("Q124"), bench.value("Q126")) == (5, 0)
    assert [
        (r.targets["X"], r.targets["Y"], r.targets["Z"]) for r in requests if isinstance(r, LinearRequest)
    ] == [(0, 6, 7)]
    bench = Bench()
    bench.programs[10] = "READ(F,X)\nRETURN"
    bench.run("CALL10 X5 F100 Y6")
    assert (bench.value("Q124"), bench.value("Q106"), bench.value("Q100")) == (5, 100, 2**23 + 2**5)
    assert bench.value("I189") == 1000


def test_the_words_that_are_left_move_together_behind_their_modal_words() -> None:
    bench = Bench()
    bench.programs[10] = "READ(X)\nRETURN"
    (move,) = bench.run("CALL10 X5 Y6 TM33 Z7 INC")
    assert isinstance(move, LinearRequest)
    assert (move.tm_ms, move.targets) == (33, {"X": 0, "Y": 6, "Z": 7})


@pytest.mark.parametrize("letter", READABLE)
def test_each_letter_has_its_variable_and_its_bit(letter: str) -> None:
    """The value of the Nth letter goes to Q(100+N), bit N-1 of Q100 says so."""
    bench = Bench()
    number = ord(letter) - ord("A") + 1
    bench.programs[10] = f"READ({letter})\nRETURN"
    bench.run(f"CALL10 {letter}(P1+8.5)")
    assert bench.value(f"Q{100 + number}") == 8.5
    assert bench.value("Q100") == 2 ** (number - 1)


@pytest.mark.parametrize("letters", ["N", "O", "X,N", "", "X Y", "TA"])
def test_read_knows_every_letter_but_n_and_o(letters: str) -> None:
    assert refusal_code(f"READ({letters})") == 3


def refusal_code(text: str) -> int:
    with pytest.raises(PmacError) as refused:
        Bench().run(text)
    return refused.value.code


def test_the_flags_are_those_of_the_most_recent_read_and_what_is_missing_keeps_its_value() -> None:
    bench = Bench(Q125=77)
    bench.programs[10] = "READ(X)\nREAD(Y,Z)\nREAD(A)\nRETURN"
    bench.run("CALL10 X1")
    assert (bench.value("Q100"), bench.value("Q125")) == (0, 77)
    bench.run("CALL10 X1 Z2")
    assert (bench.value("Q124"), bench.value("Q126"), bench.value("Q100")) == (1, 2, 0)


def test_a_second_read_goes_on_and_one_in_a_subroutine_reads_the_line_of_the_call() -> None:
    bench = Bench()
    bench.programs[10] = "READ(X)\nP1=Q124\nREAD(X,Y)\nP2=Q125\nRETURN"
    assert targets(bench.run("CALL10 X1 Y2 Z3"), "Y") == [0]
    assert (bench.value("P1"), bench.value("P2")) == (1, 2)
    bench = Bench(Q100=5)
    bench.programs[10] = "GOSUB5 RETURN\nN5 READ(X) RETURN"
    bench.run("CALL10 X9")
    assert bench.value("Q124") == 9
    bench.run("READ(X) X3")
    assert bench.value("Q100") == 0


def test_arguments_have_the_value_at_the_time_of_reading_and_no_other_effect() -> None:
    bench = Bench(P1=1)
    bench.programs[10] = "P1=5\nREAD(X)\nRETURN"
    bench.run("CALL10 X(P1)")
    assert bench.value("Q124") == 5
    # Software Reference, S: S1800 puts 1800 in Q127; the S of `G96 S50`, read, 50 in Q119.
    bench = machine_tool()
    bench.run("S1800\nG96 S50")
    assert (bench.value("Q127"), bench.value("Q119")) == (1800, 50)
    bench = machine_tool()
    assert targets(bench.run("G1 P5 Q6 H7 E8 L9 X3")) == [3]
    assert (bench.value("P5"), bench.value("Q6")) == (0, 0)


@pytest.mark.parametrize("text", ["P5", "X1 P5", "G1 DWELL5 P5", "E5", "GOSUB5 Q3"])
def test_an_argument_needs_a_call_on_its_line(text: str) -> None:
    assert refusal_code(text) == 3


def test_calls_nest_and_are_executed_each_time_in_a_loop() -> None:
    bench = Bench()
    bench.programs[1001] = "\n".join(f"N{n}000 P1=10*P1+{n} RETURN" for n in range(1, 8))
    bench.run("M1 M2 M3 M4 M5 M6 M7" + " M1" * 40)
    assert str(int(bench.value("P1"))).startswith("1234567111")
    bench = Bench()
    bench.programs[1000] = "N1000 READ(P)\nP2=P2+Q116\nRETURN"
    assert targets(bench.run("WHILE(P1<3)\nP1=P1+1\nG1 P(P1) INC X1\nENDW")) == [1, 2, 3]
    assert bench.value("P2") == 6
    bench = Bench()
    bench.programs = {10: "CALL20 X1 RETURN", 20: "X2\nCALL20.5\nRETURN\nN50000 X3 RETURN"}
    assert targets(bench.run("CALL10 X4")) == [2, 3, 1, 4]
    run = Bench().start("CALL3.5 X1 RETURN\nN50000 X2 RETURN", number=3)
    assert run.program == 3
    assert targets([run.advance(), run.advance()]) == [2, 1]
