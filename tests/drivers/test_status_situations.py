"""Each bit that the card can set, in the situation that it is for, and nothing else with it; in both families."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect, FamilySetting
from drivers.pmac.status import BitTable, decode
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

Act = Callable[[Wire], object]

MODES = {
    "LINEAR X1": "",
    "RAPID X1": "rapid",
    "SPLINE1 TM20 TA20 X1": "pvt_or_spline circle_or_spline",
    "SPLINE2 TM20 TA20 X1": "pvt_or_spline circle_or_spline",
    "CIRCLE1 X1": "circle_or_spline",
    "CIRCLE2 X1": "circle_or_spline rapid",
    "PVT20 X1:0": "pvt_or_spline rapid",
}
"""Bits 4, 1 and 0: LINEAR 000, RAPID 010, SPLINE 101, CIRCLE1 001, CIRCLE2 011, PVT 110."""

THREE = ("INC TA10 TS0 TM300", "Z300", "Z300", "Z300")


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """All three loops closed and at rest; motor 3 is Z, addressed."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/", "I319=0 I320=10 I321=0 I322=10 I311=32000 I312=16000 I328=160")
    made.sim.wait(0.2)
    return made


def told(card: Wire, question: str, table: BitTable) -> set[str]:
    (digits,) = card.ask(question)
    return set(decode(digits, table))


def motor_bits(card: Wire, motor: int = 3) -> set[str]:
    return told(card, f"#{motor}?", card.card.dialect.motor_bits)


def system_bits(card: Wire) -> set[str]:
    """Without those of the feedrate axes and of circles, which are set from the beginning."""
    always = {"x_feedrate", "y_feedrate", "z_feedrate", "radius_incremental"}
    bits = told(card, "&1??", card.card.dialect.system_bits)
    assert always <= bits
    return bits - always


def run(card: Wire, *lines: str, seconds: float = 0.1, how: str = "R") -> None:
    card.tell("OPEN PROG 1 CLEAR", *lines, "CLOSE", f"&1B1{how}")
    card.sim.wait(seconds)


def say(*lines: str, seconds: float = 0.1) -> Act:
    def act(card: Wire) -> None:
        card.tell(*lines)
        card.sim.wait(seconds)

    return act


def abort_slowly(card: Wire) -> None:
    card.tell("I315=0.01 #3J+")
    card.sim.wait(0.5)
    card.tell("&1A")


def settled(*lines: str) -> Act:
    def act(card: Wire) -> None:
        card.tell(*lines)
        card.settle()
        card.sim.wait(0.2)

    return act


def behind(counts: float) -> Act:
    def act(card: Wire) -> None:
        card.card.motors[3].desired += counts
        card.card.background()

    return act


def amplifier_fails(card: Wire) -> None:
    card.card.motors[3].fault_input = True
    card.card.background()


REST = "desired_velocity_zero in_position amplifier_enabled"
MOVES = "move_timer_active amplifier_enabled"
SEARCHES = f"{MOVES} home_search trigger_move"

MOTOR_SITUATIONS: dict[str, tuple[Act, str]] = {
    "at rest": (say(), REST),
    "killed": (say("#3K"), "open_loop"),
    "an output of 0": (say("#3O0"), "open_loop amplifier_enabled"),
    "an output": (say("#3O1"), "open_loop amplifier_enabled"),
    "a jog": (say("#3J+"), MOVES),
    "an abort": (abort_slowly, f"{MOVES} abort_deceleration"),
    "an abort that is over": (settled("#3J+", "&1A"), REST),
    "a home search": (say("#3HM", seconds=0.05), SEARCHES),
    "a home search that is over": (settled("#3HM"), f"{REST} home_complete"),
    "a home search that is killed": (say("#3HM #3K"), "open_loop"),
    "a jog until the trigger": (say("#3J:-100000^0", seconds=0.05), SEARCHES),
    "a jog that met no trigger": (settled("#3J:50^0"), f"{REST} trigger_move"),
    "beyond Ix13": (settled("I313=100", "#3J+"), f"{REST} positive_limit stopped_on_limit"),
    "beyond Ix14": (settled("I314=-100", "#3J-"), f"{REST} negative_limit stopped_on_limit"),
    "back from a limit": (settled("I313=0", "#3J/"), REST),
    "a program that moves it": (lambda card: run(card, *THREE), MOVES),
    "a program that moves another motor": (
        lambda card: run(card, "INC TA10 TS0 TM300", "Y100"),
        f"{MOVES} desired_velocity_zero",
    ),
    "a DWELL": (lambda card: run(card, "DWELL500"), f"{MOVES} desired_velocity_zero dwell"),
    "a DELAY": (lambda card: run(card, "TA10 TS0", "DELAY500"), f"{MOVES} desired_velocity_zero"),
    "outside the band of Ix28": (behind(11), "desired_velocity_zero amplifier_enabled"),
    "a warning": (behind(1001), "desired_velocity_zero amplifier_enabled warning_following_error"),
    "a fatal following error": (behind(2001), "open_loop fatal_following_error warning_following_error"),
    "a fault of the amplifier": (amplifier_fails, "open_loop amplifier_fault"),
}
"""With what is told of motor 3, beside activated, integration_mode (Ix34 is 1) and assigned."""


@pytest.mark.parametrize(("act", "bits"), MOTOR_SITUATIONS.values(), ids=MOTOR_SITUATIONS)
def test_a_motor_tells_its_situation(card: Wire, act: Act, bits: str) -> None:
    act(card)
    assert motor_bits(card) == {"activated", "integration_mode", "assigned", *bits.split()}


@pytest.mark.parametrize(
    ("line", "name"), [("I300=0", "activated"), ("I334=0", "integration_mode"), ("#3->0", "assigned")]
)
def test_a_setting_of_a_motor_takes_its_bit_away(card: Wire, line: str, name: str) -> None:
    assert name in motor_bits(card)
    card.tell(line)
    assert name not in motor_bits(card)


def test_the_bits_of_a_limit_stay_as_they_are_while_a_motor_is_killed(card: Wire) -> None:
    settled("I313=100", "#3J+")(card)
    card.tell("#3K", "I313=0")
    card.sim.wait(0.1)
    assert motor_bits(card) >= {"open_loop", "positive_limit"}
    settled("#3J/")(card)
    assert "positive_limit" not in motor_bits(card)


def stepping(card: Wire) -> None:
    run(card, *THREE, how="S")


def quit_under_way(card: Wire) -> None:
    run(card, *THREE)
    card.tell("Q")


def stop_at_the_end_of_a_block(card: Wire) -> None:
    run(card, *THREE)
    card.tell("/")


def every_move_by_itself(card: Wire) -> None:
    card.tell(f"I{card.card.dialect.system_index(1, 92)}=1")
    run(card, *THREE)


def in_segments(card: Wire) -> None:
    card.tell(f"I{card.card.dialect.index(FamilySetting.SEGMENT_MS, 1)}=10")
    run(card, *THREE)


def jogging_back(card: Wire) -> None:
    settled("#3J=900")(card)
    say("#3J=", seconds=0.05)(card)


RUNS = "running_program continuous_request continuous_motion"

SYSTEM_SITUATIONS: dict[str, tuple[Act, str]] = {
    "at rest": (say(), "in_position"),
    "a motor killed": (say("#2K"), ""),
    "a motor jogging": (say("#3J+"), ""),
    "a program by R and TM": (lambda card: run(card, *THREE), f"{RUNS} by_move_time z_incremental"),
    "a program by F": (lambda card: run(card, "INC(R) TA10 TS0 F1000", "Z500", "Z700", "Z800"), RUNS),
    "its last move": (lambda card: run(card, "ABS(X) TA10 TS0 F1000", "Z500", seconds=0.2), ""),
    "a step by S": (stepping, "single_step by_move_time z_incremental"),
    "each move by itself": (every_move_by_itself, "running_program by_move_time z_incremental"),
    "a quit": (quit_under_way, "single_step by_move_time z_incremental"),
    "a stop at the end of a block": (
        stop_at_the_end_of_a_block,
        "end_of_block_stop single_step by_move_time z_incremental",
    ),
    "a DWELL": (
        lambda card: run(card, "TA10 TS0 TM50", "DWELL500", "Z1", "Z2"),
        "running_program continuous_request by_move_time",
    ),
    "a home search of a program": (
        lambda card: run(card, "HOME3", "ABS", seconds=0.05),
        "running_program continuous_request",
    ),
    "moves in segments": (in_segments, f"{RUNS} by_move_time z_incremental segmented_move"),
    "a jog back": (jogging_back, "pre_jog"),
    "back from a jog": (settled("#3J=900", "#3J="), "in_position"),
    "a run-time error": (lambda card: run(card, "GOTO 7"), "runtime_error in_position"),
    "a warning": (behind(1001), "warning_following_error"),
    "a fatal following error": (behind(2001), "fatal_following_error warning_following_error"),
    "a fault of the amplifier": (amplifier_fails, "amplifier_fault"),
}


@pytest.mark.parametrize(("act", "bits"), SYSTEM_SITUATIONS.values(), ids=SYSTEM_SITUATIONS)
def test_a_coordinate_system_tells_its_situation(card: Wire, act: Act, bits: str) -> None:
    act(card)
    expected = set(bits.split())
    if "z_incremental" in expected:
        expected |= {"x_incremental", "y_incremental"}
    assert system_bits(card) == expected


@pytest.mark.parametrize(("line", "mode"), MODES.items())
def test_three_bits_tell_the_mode_of_motion(card: Wire, line: str, mode: str) -> None:
    card.tell("I13=0" if card.card.dialect is PMAC else "I5113=0")
    run(card, "TA10 TS0 TM50", line)
    card.settle()
    assert system_bits(card) & {"pvt_or_spline", "rapid", "circle_or_spline"} == set(mode.split())


@pytest.mark.parametrize("axis", "ABCUVWXYZ")
def test_each_axis_has_a_bit_for_inc_and_one_for_frax(card: Wire, axis: str) -> None:
    for line, name, expected in (
        (f"ABS INC({axis})", "incremental", {axis}),
        (f"ABS({axis})", "incremental", set()),
        (f"FRAX({axis})", "feedrate", {axis}),
        ("NOFRAX", "feedrate", set()),
        ("FRAX", "feedrate", set("XYZ")),  # those that have a motor
    ):
        run(card, line)
        bits = told(card, "&1??", card.card.dialect.system_bits)
        assert {letter for letter in "ABCUVWXYZ" if f"{letter.lower()}_{name}" in bits} == expected, line


def test_vectors_to_the_centre_have_a_bit_for_inc(card: Wire) -> None:
    for line, expected in (("ABS(R)", False), ("INC(R)", True)):
        run(card, line)
        assert ("radius_incremental" in told(card, "&1??", card.card.dialect.system_bits)) is expected


def test_an_arc_without_a_radius_has_a_bit_of_its_own_beside_the_run_time_error(card: Wire) -> None:
    card.tell(f"I{card.card.dialect.index(FamilySetting.SEGMENT_MS, 1)}=10")
    for arc in ("X10 Y10 R0", "X10 Y10 I0 J0"):
        run(card, "INC TA10 TS0 TM50 CIRCLE1", arc)
        assert system_bits(card) >= {"runtime_error", "circle_radius_error"}
        run(card, "LINEAR X1")
        card.settle()
        assert not system_bits(card) & {"runtime_error", "circle_radius_error"}


def test_a_program_hold_has_a_bit_on_a_pmac(card: Wire) -> None:
    run(card, *THREE)
    card.tell("\\")
    assert ("program_hold" in system_bits(card)) is (card.card.dialect is PMAC)


def test_a_motor_off_its_place_is_a_resume_error_on_a_turbo(card: Wire) -> None:
    run(card, *THREE, how="S")
    card.settle()
    settled("#3J:50")(card)
    assert card.refusal("R") == 17
    assert ("resume_error" in system_bits(card)) is (card.card.dialect is TURBO)
    settled("#3J=")(card)
    card.tell("R")
    assert "resume_error" not in system_bits(card)


def test_status_words_have_six_digits_each(card: Wire) -> None:
    """Two of a motor and of the card; of a coordinate system two, on a Turbo three."""
    systems = {"pmac": 12, "turbo": 18}[card.card.dialect.name]
    assert [len(digits) for digits in card.ask("? ?? ???")] == [12, systems, 12]


def test_the_card_tells_which_buffer_is_open(card: Wire) -> None:
    table = card.card.dialect.global_bits
    for line, name in (("OPEN PROG 1", "motion_buffer_open"), ("OPEN PLC 1", "plc_buffer_open")):
        assert told(card, "???", table) == {"this_card_addressed"}
        card.tell(line)
        assert told(card, "???", table) == {"this_card_addressed", name}
        card.tell("CLOSE")


def test_the_card_tells_whether_it_is_meant_alone_or_with_all_others(card: Wire) -> None:
    table = card.card.dialect.global_bits
    card.raw("I1=2\r@@\r")
    assert told(card, "???", table) == {"all_cards_addressed"}
    card.raw("@0\r")
    assert told(card, "???", table) == {"this_card_addressed"}
