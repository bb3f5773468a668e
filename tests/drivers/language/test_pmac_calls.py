"""Calls of other programs: CALL, G, M, T and D codes, and the arguments that READ takes from the calling line."""

from __future__ import annotations

import pytest

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import READABLE
from drivers.pmac.requests import CircleRequest, DwellRequest, LinearRequest, RapidRequest
from tests.drivers.language.runs import Bench, targets

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


def refusal(bench: Bench, text: str) -> str:
    with pytest.raises(PmacError) as refused:
        bench.run(text)
    return refused.value.detail


def test_call_runs_another_program_and_comes_back_behind_itself() -> None:
    bench = Bench()
    bench.programs[500] = "X1\nX2\nRETURN\nX3"
    assert targets(bench.run("CALL500 X9\nX10")) == [1, 2, 9, 10]


def test_the_fraction_of_call_is_a_label_of_five_digits() -> None:
    """CALL 35.1 is N10000 of program 35, CALL 47.123 N12300 of 47 (Software Reference, CALL)."""
    bench = Bench()
    bench.programs = {35: "X1 RETURN\nN10000 X2 RETURN", 47: "N12300 X3 RETURN"}
    assert targets(bench.run("CALL 35\nCALL 35.1\nCALL(40+7.123)")) == [1, 2, 3]


@pytest.mark.parametrize("call", ["CALL7", "CALL35.2", "CALL0", "CALL-1", "CALL32768"])
def test_a_call_of_what_is_not_there_is_a_run_time_error(call: str) -> None:
    bench = Bench()
    bench.programs[35] = "X1"
    assert "CALL" in refusal(bench, call)


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
def test_codes_are_calls_of_programs_1000_to_1003_and_the_hundreds_add_ten(
    code: str, program: int, label: int
) -> None:
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
    assert "0 to 999.999" in refusal(Bench(), code)


def test_m_and_i_without_equals_are_a_code_and_a_vector() -> None:
    bench = Bench(M1=7, I100=1)
    bench.programs[1001] = "N1000 X5 RETURN"
    assert targets(bench.run("M1\nI100")) == [5]
    assert (bench.value("M1"), bench.value("I100")) == (7, 1)


def test_m00_is_the_beginning_of_its_program() -> None:
    """A program always begins with an implicit N0 (User Manual, M00)."""
    bench = Bench()
    bench.programs[1001] = "X5\nRET\nN1000 X6\nRET"
    assert targets(bench.run("M00")) == [5]


def test_a_rs274_program_runs_as_it_stands() -> None:
    text = "G17 G90 G0 X10 Y10\nG1 X20 F600\nG2 X30 Y10 I5 J0\nG91 G01 X-5\nM3 G4 P250\nG92 X0\nM30"
    requests = machine_tool().run(text)
    assert [type(r).__name__ for r in requests] == [
        "RapidRequest",
        "LinearRequest",
        "CircleRequest",
        "LinearRequest",
        "DwellRequest",
        "PresetRequest",
    ]
    rapid, line, arc, back, dwell, _ = requests
    assert isinstance(rapid, RapidRequest) and rapid.targets["Y"] == 10
    assert isinstance(line, LinearRequest) and line.tm_ms == 10 / 600 * 1000
    assert isinstance(arc, CircleRequest) and arc.clockwise and arc.center == {"X": 5, "Y": 0, "Z": 0}
    assert isinstance(back, LinearRequest) and back.targets["X"] == 25
    assert isinstance(dwell, DwellRequest) and dwell.duration_ms == 250
    assert [d.value for d in dwell.deferred] == [1]


def test_what_read_takes_is_not_executed_after_the_return_and_the_rest_is() -> None:
    bench = Bench()
    bench.programs[10] = "READ(X,P)\nRETURN"
    requests = bench.run("CALL10 X5 P7 Y3")
    assert targets(requests, "X") == [0] and targets(requests, "Y") == [3]
    assert (bench.value("Q124"), bench.value("Q116")) == (5, 7)


def test_read_stops_at_the_first_letter_that_is_not_asked_for() -> None:
    bench = Bench()
    bench.programs[10] = "READ(X,Z)\nRETURN"
    requests = bench.run("CALL10 X5 Y6 Z7")
    assert bench.value("Q100") == 2**23
    assert (bench.value("Q124"), bench.value("Q126")) == (5, 0)
    assert [
        (r.targets["X"], r.targets["Y"], r.targets["Z"]) for r in requests if isinstance(r, LinearRequest)
    ] == [(0, 6, 7)]


def test_the_words_of_the_line_are_read_in_the_order_in_which_they_stand() -> None:
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


def test_a_second_read_goes_on_where_the_first_one_stopped() -> None:
    bench = Bench()
    bench.programs[10] = "READ(X)\nP1=Q124\nREAD(X,Y)\nP2=Q125\nRETURN"
    assert targets(bench.run("CALL10 X1 Y2 Z3"), "Y") == [0]
    assert (bench.value("P1"), bench.value("P2")) == (1, 2)


def test_read_in_a_subroutine_reads_the_line_of_the_call_and_none_without_a_call() -> None:
    bench = Bench(Q100=5)
    bench.programs[10] = "GOSUB5 RETURN\nN5 READ(X) RETURN"
    bench.run("CALL10 X9")
    assert bench.value("Q124") == 9
    bench.run("READ(X) X3")
    assert bench.value("Q100") == 0


def test_the_value_of_an_argument_is_that_at_the_time_of_reading() -> None:
    bench = Bench(P1=1)
    bench.programs[10] = "P1=5\nREAD(X)\nRETURN"
    bench.run("CALL10 X(P1)")
    assert bench.value("Q124") == 5


def test_s_alone_goes_to_q127_and_as_an_argument_to_q119() -> None:
    """Software Reference, S: S1800 puts 1800 in Q127; the S of `G96 S50`, read, 50 in Q119."""
    bench = machine_tool()
    bench.run("S1800\nG96 S50")
    assert (bench.value("Q127"), bench.value("Q119")) == (1800, 50)


def test_an_argument_that_nobody_reads_has_no_effect() -> None:
    bench = machine_tool()
    assert targets(bench.run("G1 P5 Q6 H7 E8 L9 X3")) == [3]
    assert (bench.value("P5"), bench.value("Q6")) == (0, 0)


@pytest.mark.parametrize("text", ["P5", "X1 P5", "G1 DWELL5 P5", "E5", "GOSUB5 Q3"])
def test_an_argument_needs_a_call_on_its_line(text: str) -> None:
    assert refusal_code(text) == 3


def test_codes_one_after_another_on_a_line_are_all_executed() -> None:
    bench = Bench()
    bench.programs[1001] = "\n".join(f"N{n}000 P1=10*P1+{n} RETURN" for n in range(1, 8))
    bench.run("M1 M2 M3 M4 M5 M6 M7" + " M1" * 40)
    assert str(int(bench.value("P1"))).startswith("1234567111")


def test_a_calling_line_in_a_loop_is_executed_each_time() -> None:
    bench = Bench()
    bench.programs[1000] = "N1000 READ(P)\nP2=P2+Q116\nRETURN"
    assert targets(bench.run("WHILE(P1<3)\nP1=P1+1\nG1 P(P1) INC X1\nENDW")) == [1, 2, 3]
    assert bench.value("P2") == 6


def test_calls_nest_and_programs_can_call_themselves_at_another_label() -> None:
    bench = Bench()
    bench.programs = {10: "CALL20 X1 RETURN", 20: "X2\nCALL20.5\nRETURN\nN50000 X3 RETURN"}
    assert targets(bench.run("CALL10 X4")) == [2, 3, 1, 4]


def test_the_first_program_can_be_called_by_its_number_without_a_library() -> None:
    run = Bench().start("CALL3.5 X1 RETURN\nN50000 X2 RETURN", number=3)
    assert run.program == 3
    assert targets([run.advance(), run.advance()]) == [2, 1]
