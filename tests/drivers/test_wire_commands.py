"""The on-line commands of motors and coordinate systems, and the number of each refusal."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.card import buffers
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Loops closed; the spindle is motor 2, and stands at 0."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    return made


def place(card: Wire, motor: int = 2) -> float:
    return float(card.ask(f"#{motor}P")[0])


def test_j_plus_and_minus_jog_until_j_slash(card: Wire) -> None:
    card.tell("I222=10 #2J+")
    card.sim.wait(1.0)
    assert float(card.ask("V")[0]) == pytest.approx(10 * card.card.servo_period_ms, abs=1)
    card.tell("J-")
    card.sim.wait(1.0)
    assert float(card.ask("V")[0]) == pytest.approx(-10 * card.card.servo_period_ms, abs=1)
    card.tell("J/")
    card.settle()
    card.sim.wait(0.2)  # the velocity of a Turbo is an average
    assert card.ask("V") == ["0"]


def test_a_slash_and_a_dollar_close_the_loop_and_dollar_star_kills(card: Wire) -> None:
    for line, enabled in (("#2K", False), ("J/", True), ("$*", False), ("$", True)):
        card.tell(line)
        assert card.card.motors[2].enabled is enabled, line


def test_jogs_to_a_place_and_back_and_relative_ones(card: Wire) -> None:
    card.tell("#2J=100")
    card.settle()
    card.tell("J=-300.5")
    card.settle()
    assert place(card) == pytest.approx(-300.5, abs=1)
    card.tell("J=")
    card.settle()
    assert place(card) == 100
    card.tell("#2J=100")
    card.settle()
    card.tell("J:50")
    card.settle()
    assert place(card) == 150
    card.tell("J^-20")
    card.settle()
    assert place(card) == 130


def test_the_star_stands_for_the_variable_jog_register(card: Wire) -> None:
    register = {"pmac": "$8EB", "turbo": "$157"}[card.card.dialect.name]
    card.tell(f"M272->L:{register} M272=40", "#2J=*")
    card.settle()
    card.tell("J:*")
    card.settle()
    assert place(card) == 80
    card.tell("J^*")
    card.settle()
    assert place(card) == 120


@pytest.mark.parametrize("jog", ["J=15000^-40", "J:15000^-40", "J^15000^-40", "J=*^-40", "J:*^-40", "J^*^-40"])
def test_every_jog_to_a_place_may_go_until_the_trigger(card: Wire, jog: str) -> None:
    motor = card.card.motors[2]
    motor.variable_jog = 15000
    card.tell(f"#2{jog}")
    card.settle()
    assert (place(card) + motor.axis.origin + 40) % 10_000 == pytest.approx(0, abs=1)


def test_hm_and_home_search_the_trigger_and_hmz_needs_none(card: Wire) -> None:
    for word in ("HM", "HOME"):
        card.tell("#2J=1234")
        card.settle()
        card.tell(f"#2{word}")
        card.settle()
        assert place(card) == 0
    card.tell("#2J=777")
    card.settle()
    origin = card.card.motors[2].axis.origin
    card.tell("HMZ")
    assert place(card) == 0
    assert card.card.motors[2].axis.origin == origin + 777
    assert card.card.motors[2].home_complete


def test_o_opens_the_loop_with_an_output_and_k_takes_it_away(card: Wire) -> None:
    card.tell("#1O0")
    on, off = {"pmac": ("840000804000", "840000800000"), "turbo": ("8C0000078000", "840000078000")}[
        card.card.dialect.name
    ]
    assert card.ask("?") == [on]
    card.tell("K")
    assert card.ask("?") == [off]


def test_a_position_has_its_fraction_when_the_zero_has_one(card: Wire) -> None:
    """P in tenths of a count, on a Turbo in thirty-seconds (Software References)."""
    card.card.motors[2].bias = 0.27
    assert card.ask("#2P") == [{"pmac": "0.3", "turbo": "0.28125"}[card.card.dialect.name]]


@pytest.mark.parametrize("line", ["J", "J*", "J:", "J^", "J=5^", "JX", "O", "J+5+"])
def test_what_is_no_jog(card: Wire, line: str) -> None:
    assert card.refusal(f"#2{line}") in (3, 5)


@pytest.mark.parametrize(
    "jog", ["J={}", "J=-{}", "J:{}", "J:-{}", "J^{}", "J=1^{}", "J:1^-{}", "J^1^{}", "J=*", "J:*", "J^*"]
)
def test_a_jog_goes_no_farther_than_the_registers_reach(card: Wire, jog: str) -> None:
    """48 bits, with a sign, in units of 1/(96 x 32) count."""
    farthest = 2.0**47 / (96 * 32)
    card.card.motors[2].variable_jog = 1e20
    for counts in ("99999999999999999999", f"{farthest + 2000:.0f}"):
        assert card.refusal("#2" + jog.format(counts)) == 3
    assert not card.card.motors[2].jogging
    card.tell(f"#2J={int(farthest)}")
    assert card.card.motors[2].jogging


def test_addresses_are_kept_and_told(card: Wire) -> None:
    assert card.ask("#3 &5 # &") == ["3", "5"]
    assert card.ask("#&") == ["3", "5"]
    motors, systems = {"pmac": (8, 8), "turbo": (32, 16)}[card.card.dialect.name]
    lines = ("#0", f"#{motors + 1}", "&0", f"&{systems + 1}")
    assert [card.refusal(line) for line in lines] == [3] * 4
    assert card.ask(f"#{motors} &{systems} # #1 # &") == [str(motors), "1", str(systems)]


def test_number_9_counts_a_cycle_are_counts_a_ms_by_i10(card: Wire) -> None:
    """21.9 counts a servo cycle x 8388608 / 3713707 are 49.5 counts/ms (Software Reference, V)."""
    card.tell("I10=3713707 I219=0 I220=10 I221=0 I222=49.5 #2J+")
    card.sim.wait(1.0)
    told = []
    for _ in range(200):
        card.sim.wait(0.005)
        told.append(float(card.ask("#2V")[0]))
    assert sum(told) / len(told) == pytest.approx(21.9, abs=0.1)


def test_motors_are_asked_in_one_line_and_a_space_parts_the_sign_that_asks(card: Wire) -> None:
    card.card.motors[5].bias = 7
    assert card.ask("#5P#2P") == ["7", "0"]
    assert card.ask("#5V#2V") == ["0", "0"]
    assert card.ask("#") == ["2"]
    # Without it, `##3` would choose the last eight motors of a Turbo.
    assert card.ask("#4 # #3 #") == ["4", "3"]


# The on-line commands of coordinate systems, as they are typed.


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def program_card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Loops closed; program 1 goes three steps of 30 counts in X, each in 100 ms."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", "INC TA10 TS0 TM100", "Z30", "Z30", "N500 Z30", "CLOSE")
    return made


def carriage_place(program_card: Wire) -> float:
    return float(program_card.ask("#3P")[0])


def test_b_and_r_run_from_the_top_or_a_label_and_s_does_one_move(program_card: Wire) -> None:
    """The fraction is the label in units of 1/100000: N500 is .005."""
    for line, end in (("&1B1R", 90), ("B1.005R", 120), ("B1S", 150), ("S", 180), ("S", 210)):
        program_card.tell(line)
        program_card.settle()
        assert carriage_place(program_card) == end, line


@pytest.mark.parametrize("number", ["0", "0.5", "32768", "99999999999999"])
def test_003_a_program_number_that_there_cannot_be(program_card: Wire, number: str) -> None:
    assert program_card.refusal(f"B{number}") == 3
    program_card.tell("B32767", "B1")


HELD = range(1, 90)
WORDS = {"Q": (0.03, (30, 60)), "/": (0.03, (30, 60)), "A": (0.1, HELD), "H": (0.1, HELD), "\\": (0.1, HELD)}
"""When a word comes, and where the axis may come to rest: whole moves of 30 counts where they are finished."""


@pytest.mark.parametrize(("word", "after_s", "places"), [(word, *row) for word, row in WORDS.items()])
def test_what_stops_a_program_and_that_r_goes_on(
    program_card: Wire, word: str, after_s: float, places: Sequence[int]
) -> None:
    program_card.tell(f"I{program_card.card.dialect.system_index(1, 95)}=50000", "B1R")
    program_card.sim.wait(after_s)
    program_card.tell(word)
    program_card.sim.wait(2.0)
    held = carriage_place(program_card)
    assert round(held) in places
    program_card.sim.wait(1.0)
    assert carriage_place(program_card) == held
    if word != "A":
        program_card.tell("R")
        program_card.settle()
        assert carriage_place(program_card) == 90


def test_percent_sets_and_reports_the_time_base(program_card: Wire) -> None:
    program_card.tell(f"I{program_card.card.dialect.system_index(1, 94)}=8388607", "%50")
    program_card.sim.wait(0.1)
    assert program_card.ask("%") == ["50"]
    program_card.tell("B1R")
    program_card.sim.wait(0.31)
    assert program_card.card.systems[1].moving
    assert carriage_place(program_card) < 60
    program_card.settle()
    assert carriage_place(program_card) == 90


def test_the_program_counter_and_what_is_executed(program_card: Wire) -> None:
    """P{program}:{line}; the counter is ahead of the motion by a move."""
    program_card.tell("B1")
    assert program_card.ask("PC LIST PC LIST PE,2") == ["P1:0", *["P1:0:INCTA10TS0TM100"] * 2, "P1:2:Z30"]
    program_card.tell("R")
    program_card.sim.wait(0.05)
    (counter,) = program_card.ask("PC")
    (executing,) = program_card.ask("PE")
    assert counter.startswith("P1:")
    assert executing.startswith("P1:")
    assert int(counter[3:]) >= int(executing[3:])
    assert program_card.ask("PR") == ["0"]


def test_an_axis_is_called_something_else_without_a_move(program_card: Wire) -> None:
    program_card.tell("Z=1000")
    before = program_card.card.motors[3].actual
    program_card.tell("OPEN PROG2 CLEAR", "ABS TA10 TS0 TM100", "Z1010", "CLOSE", "B2R")
    program_card.settle()
    assert program_card.card.motors[3].actual - before == pytest.approx(10, abs=0.5)
    assert program_card.refusal("U=5") == 3


def test_z_calls_every_axis_zero(program_card: Wire) -> None:
    program_card.tell("#3J=500")
    program_card.settle()
    program_card.tell("Z", "OPEN PROG2 CLEAR", "ABS TA10 TS0 TM100", "Z10", "CLOSE", "B2R")
    before = program_card.card.motors[3].actual
    program_card.settle()
    assert program_card.card.motors[3].actual - before == pytest.approx(10, abs=0.5)


def test_pmatch_takes_the_axes_to_be_where_the_motors_are(program_card: Wire) -> None:
    program_card.tell("#3J=500")
    program_card.settle()
    program_card.tell("PMATCH", "OPEN PROG2 CLEAR", "ABS TA10 TS0 TM100", "Z500", "CLOSE", "B2R")
    program_card.settle()
    assert carriage_place(program_card) == 500


def test_axis_definitions_are_asked_for_as_clients_do(program_card: Wire) -> None:
    assert program_card.ask("&1#1->, #2->, #3->,") == ["X", "Y", "Z"]
    assert program_card.ask("#4->") == ["0"]
    program_card.tell("#3->0", "#3->8660Z+10.5")
    assert program_card.ask("#3->") == ["8660Z+10.5"]


def test_undefine_forgets_the_axes_of_a_system_and_undefine_all_those_of_all(program_card: Wire) -> None:
    program_card.tell("#3->0", "&2 #3->A", "&1 UNDEFINE")
    assert program_card.ask("#1-> #2-> #3->") == ["0", "0", "0"]
    assert program_card.ask("&2#3->&1") == ["A"]
    program_card.tell("UNDEFINE ALL")
    assert program_card.ask("&2#3->&1") == ["0"]
    assert program_card.refusal("&1 B1R") == 14


# The list of error numbers: for each of them what brings it about, in both families (Software Reference, I6).

Prepare = Callable[[Wire], object]


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def closed_card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """All loops closed; coordinate system 1 is addressed."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    made.sim.wait(0.1)
    return made


def after(*lines: str, seconds: float = 0.0) -> Prepare:
    def prepare(closed_card: Wire) -> None:
        closed_card.tell(*lines)
        closed_card.sim.wait(seconds)

    return prepare


def program(*lines: str, then: str = "&1B1", seconds: float = 0.0) -> Prepare:
    return after("OPEN PROG 1 CLEAR", *lines, "CLOSE", then, seconds=seconds)


def running(closed_card: Wire) -> None:
    program("INC TA10 TS0 TM100", "WHILE(P1=0)", "X10", "X-10", "ENDWHILE", then="&1B1R", seconds=0.3)(closed_card)


def locked(closed_card: Wire) -> None:
    closed_card.tell("PASSWORD=secret")
    closed_card.raw("$$$\rI3=2 I6=1\r")


def both_limits(closed_card: Wire) -> None:
    program("X1")(closed_card)
    travel = closed_card.card.motors[3].travel
    travel.plus_pin = travel.minus_pin = True
    closed_card.sim.wait(0.1)


def moved_since_the_stop(closed_card: Wire) -> None:
    program("INC TA10 TS0 TM100", "Z30", "Z30", then="&1B1S")(closed_card)
    closed_card.settle()
    closed_card.tell("#3J:5")
    closed_card.settle()


ROWS: dict[str, tuple[int, Prepare, str]] = {
    "001 a jog while a program runs": (1, running, "#1J+"),
    "001 a kill while a program runs": (1, running, "#1K"),
    "001 a second start": (1, running, "R"),
    "001 a buffer while a program runs": (1, running, "OPEN PROG 2"),
    "002 a protected program": (2, locked, "OPEN PROG 1000"),
    "002 the last program": (2, locked, "LIST PROG 32767"),
    "002 another password": (2, locked, "PASSWORD=Secret"),
    "003 no command": (3, after(), "UUU"),
    "003 no such motor": (3, after(), "#33"),
    "003 a motor of another system": (3, after(), "&2#1->X"),
    "003 no such program": (3, after(), "LIST PROG 9"),
    "004 a character above 127": (4, after(), "P1=1\x80"),
    "004 the highest character": (4, after(), "\xff"),
    "005 a move": (5, after(), "X100"),
    "005 CLEAR": (5, after(), "CLEAR"),
    "006 no room": (6, program("X1", "X2", then="OPEN PROG 1"), "X3"),
    "007 a second buffer": (7, after("OPEN PROG 1"), "OPEN PLC 1"),
    "009 ENDIF without IF": (9, program("ENDIF"), "R"),
    "009 ENDWHILE without WHILE": (9, program("ENDWHILE"), "R"),
    "010 both limits": (10, both_limits, "R"),
    "011 the move before": (11, program("INC TA10 TS0 TM500", "X10", "X10", then="&1B1S", seconds=0.1), "S"),
    "012 open loop": (12, program("X1", then="#2K &1B1"), "R"),
    "013 not activated": (13, program("X1", then="I300=0 &1B1"), "R"),
    "013 a jog": (13, after("I300=0"), "#3J+"),
    "014 no motors": (14, program("X1", then="&2B1"), "R"),
    "015 pointing to nothing": (15, after(), "R"),
    "015 pointing to what is not there": (15, after("B7"), "R"),
    "015 not pointed again after OPEN": (15, program("X1", then="&1B1 OPEN PROG 2 CLOSE"), "R"),
    "016 ENDWHILE is missing": (16, program("WHILE(P1=0)", "X1"), "R"),
    "016 ENDIF is missing": (16, program("IF(P1=0)", "X1"), "R"),
    "017 off the stopped position": (17, moved_since_the_stop, "R"),
    "018 phasing in motion": (18, after("#3J+", seconds=0.2), "#3$"),
}


@pytest.mark.parametrize(("number", "prepare", "line"), ROWS.values(), ids=ROWS)
def test_an_error_number_stands_for_one_kind_of_refusal(
    closed_card: Wire, monkeypatch: pytest.MonkeyPatch, number: int, prepare: Prepare, line: str
) -> None:
    """BELL, ERR and three digits, CR, and no acknowledgement."""
    monkeypatch.setattr(buffers, "MAX_LINES", 5)
    if number == 6:
        monkeypatch.setattr(buffers, "MAX_LINES", 2)
    prepare(closed_card)
    assert closed_card.raw(f"{line}\r".encode("latin-1")) == b"\x07ERR%03d\r" % number


def test_what_has_a_number_is_what_the_list_has() -> None:
    """008 (MACRO) and 019 (cutter compensation) have no cause here; 000 and 020 are not in the list."""
    assert {number for number, _, _ in ROWS.values()} == set(range(1, 20)) - {8, 19}


def test_a_password_opens_what_it_protects(closed_card: Wire) -> None:
    locked(closed_card)
    closed_card.tell("OPEN PROG 999", "CLOSE", "PASSWORD=secret", "OPEN PROG 1000", "CLOSE")


def test_a_carriage_return_that_a_bad_line_has_spoilt_is_answered_by_nothing(closed_card: Wire) -> None:
    """With its parity bit set it ends no line: there is nothing to answer until the next one."""
    assert closed_card.raw(b"P1=1\x8d") == b""
    closed_card.sim.wait(1.0)
    assert closed_card.port.take_output() == b""
    assert closed_card.raw(b"\r") == b"\x07ERR004\r"
    assert closed_card.ask("P1") == ["0"]


@pytest.mark.parametrize(
    "word", ["RAPID", "RETURN", "RET", "STOP", "SPLINE1", "ABS", "READ(A)", "PSET X0", "FRAX(X)"]
)
def test_005_a_word_of_programs_is_not_taken_letter_by_letter(closed_card: Wire, word: str) -> None:
    """R alone would run the program, S step it, A abort."""
    closed_card.tell(
        "OPEN PROG 1 CLEAR", "LINEAR INC TA10 TS0 TM1000", "X10", "X-10", "CLOSE", "#1J/#2J/#3J/", "&1B1"
    )
    assert closed_card.raw(f"{word}\r").endswith(b"\x07ERR005\r")
    closed_card.sim.wait(0.1)
    assert not closed_card.card.systems[1].running
    assert all(closed_card.card.motors[motor].enabled for motor in (1, 2, 3))
    closed_card.tell("&1R")
    assert closed_card.raw(f"{word}\r").endswith(b"\x07ERR005\r")
    closed_card.sim.wait(0.1)
    assert closed_card.card.systems[1].running, "and nothing that runs is aborted"
