"""Hosts that flood the card, whatever they send: everybody else is served, and a stop acts at once."""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import TURBO
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.hosts.port import INBOX_LIMIT, LINES_PER_TURN, WORK_PER_CYCLE
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench
from tests.drivers.wire_card import CYCLE_S, BoardWire, Wire, wire, wire_board

VALUES = 8192
"""I0 to I8191."""

RANGE = b"I0..8191\r"


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


@pytest.fixture
def board(machine: MachineProfile) -> BoardWire:
    return wire_board(machine, TURBO)


def answers(card: Wire, cycles: int) -> bytes:
    said = b""
    for _ in range(cycles):
        card.sim.wait(CYCLE_S)
        said += card.port.take_output()
    return said


def counted(monkeypatch: pytest.MonkeyPatch, name: str) -> list[str]:
    """Count how often the card is told to do something."""
    calls: list[str] = []
    done: Callable[[SimulatedController], None] = getattr(SimulatedController, name)

    def act(controller: SimulatedController) -> None:
        calls.append(name)
        done(controller)

    monkeypatch.setattr(SimulatedController, name, act)
    return calls


@pytest.mark.parametrize("report", [b"\x02", b"\x03", b"\x06", b"\x07", b"\x10", b"\x16"])
def test_reports_beyond_the_share_wait_in_their_order_and_none_is_lost(card: Wire, report: bytes) -> None:
    one = card.raw(report)
    card.port.receive(report * 300 + b"P1\r")
    card.sim.attend(card.port)
    assert card.port.take_output() == one * LINES_PER_TURN
    assert answers(card, 100) == one * (300 - LINES_PER_TURN) + b"0\r\x06"


def test_another_host_is_answered_and_heard_at_once_while_reports_wait(card: Wire) -> None:
    card.tell("I200=1", "#2J/")
    other = card.sim.connect()
    card.port.receive(b"\x03" * 64_000)
    card.sim.attend(card.port)
    other.receive(b"P1\r\x0b")
    card.sim.attend(other)
    assert other.take_output() == b"0\r\x06"
    assert not card.card.motors[2].enabled


def test_a_stop_of_the_same_host_does_not_wait_for_its_reports(card: Wire) -> None:
    card.tell("I200=1", "#2J/")
    card.port.receive(b"\x03" * 1000 + b"\x0b")
    card.sim.attend(card.port)
    assert not card.card.motors[2].enabled
    card.port.receive(b"\x18P1\r")
    card.sim.attend(card.port)
    assert card.port.take_output() == b"0\r\x06"


def test_a_report_between_two_stops_tells_of_the_first(card: Wire) -> None:
    card.tell("I200=1", "#2J/")
    closed, opened = card.raw(b"\x01\x02"), card.raw(b"\x0b\x02")
    assert opened != closed
    assert card.raw(b"\x01\x02\x0b\x02") == closed + opened


def test_thousands_of_stops_in_one_go_are_a_few(card: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    aborts, kills = counted(monkeypatch, "abort_all"), counted(monkeypatch, "kill_all")
    card.tell("I200=1", "#2J/")
    card.port.receive(b"\x01\x0b" * 30_000 + b"P1\r\x01" * 1000)
    card.sim.attend(card.port)
    assert (len(aborts), len(kills)) == (1, 1)
    assert card.card.motors[2].enabled


def test_control_characters_in_the_text_of_an_ethernet_client_have_the_same_share(board: BoardWire) -> None:
    board.response(b"I3=2")
    board.session.receive(struct.pack(">BBHHH", 0x40, 0xB0, 0, 0, 1000) + b"\x07" * 1000)
    assert board.session.turn() == [b"@"]
    assert 0 < board.session._queue.count(b"\r") <= 2 * LINES_PER_TURN


def test_requests_of_an_ethernet_client_that_does_not_wait_have_the_same_share(board: BoardWire) -> None:
    board.response(b"I3=2")
    request = struct.pack(">BBHHH", 0x40, 0xBF, 0, 0, 8) + b"I0..8191"
    flush = struct.pack(">BBHHH", 0x40, 0xB3, 0, 0, 0)
    board.session.receive((request + flush) * 100)
    said = []
    for _ in range(80):
        board.sim.wait(CYCLE_S)
        turn: list[bytes] = []
        while not turn or board.session.busy:
            turn = board.session.turn()
            said += turn
            if not turn:
                break
    assert len(said) / 2 == pytest.approx(80 * WORK_PER_CYCLE / VALUES, abs=2)


def test_commands_of_programs_have_a_share_too(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", *('CMD"P1..8191=P1+1"' for _ in range(20)), "CLOSE", "#1J/ #2J/ #3J/", "B1R")
    card.sim.wait(CYCLE_S)
    counts = [p1(card)]
    for _ in range(5):
        card.sim.wait(CYCLE_S)
        counts.append(p1(card))
    assert max(after - before for before, after in pairwise(counts)) == 1


def test_who_asks_for_or_assigns_thousands_of_values_waits_for_them(card: Wire) -> None:
    """Each line is as much as eight background cycles make good; a first one is there at once."""
    card.port.receive(RANGE * 100)
    said = answers(card, 80)
    assert said.count(b"\x06") == pytest.approx(80 * WORK_PER_CYCLE / VALUES, abs=2)
    other = card.sim.connect()
    for _ in range(10):
        other.receive(b"P1\r")
        card.sim.attend(other)
        assert other.take_output() == b"0\r\x06"
        card.sim.wait(CYCLE_S)
    card.port.receive(b"P1..8191=SIN(P1)\r" * 100)
    assert answers(card, 80).count(b"\x06") == pytest.approx(80 * WORK_PER_CYCLE / VALUES, abs=2)


def p1(card: Wire) -> float:
    return card.card.variables.get(VariableKind.P, 1)


def test_a_long_line_of_heavy_commands_is_done_in_parts_and_answered_once(card: Wire) -> None:
    card.port.receive(b"P1..8191=P1+1" * 12 + b"P1\r")
    done = []
    while not card.port.idle:
        card.sim.attend(card.port)
        done.append(p1(card))
    assert done[:12] == [*range(1, 13)]
    assert card.port.take_output() == b"12\r\x06"
    said = card.raw(b"I0..8191" * 5 + b"\r")
    assert said == (card.raw(RANGE)[:-1]) * 5 + b"\x06"


def test_an_error_ends_a_line_that_is_done_in_parts(card: Wire) -> None:
    assert card.raw(b"P1..8191=P1+1P1..8191=P1+1CLEAR P1=7\r") == b"\x07ERR005\r"
    assert p1(card) == 2


def test_control_x_ends_a_line_that_is_done_in_parts(card: Wire) -> None:
    card.port.receive(b"P1..8191=P1+1" * 12 + b"\r")
    card.sim.attend(card.port)
    assert card.raw(b"\x18P0\r") == b"0\r\x06"
    assert p1(card) == 1


def test_a_program_that_is_listed_counts_with_its_lines(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", *("X1" for _ in range(600)), "CLOSE")
    card.sim.wait(20 * CYCLE_S)
    card.port.receive(b"LIST PROG 1\r" * 100)
    assert answers(card, 90).count(b"\x06") <= 15


def test_a_line_that_is_repeated_thousands_of_times_is_a_line_each_time(card: Wire) -> None:
    card.raw(b"P1=P1+1\r")
    card.port.receive(b"\t" * 60_000)
    card.sim.attend(card.port)
    assert p1(card) == 1 + LINES_PER_TURN


@pytest.mark.parametrize(("sent", "said"), [(b"\x19", b"P0..1000"), (b"\x0e", b"\0")])
def test_questions_about_the_line_itself_have_a_share_too(card: Wire, sent: bytes, said: bytes) -> None:
    card.raw(b"P0..1000\r")
    card.sim.wait(20 * CYCLE_S)
    card.port.receive(sent * 60_000)
    card.sim.attend(card.port)
    assert 0 < card.port.take_output().count(said) < 1000


@pytest.mark.parametrize(("stop", "closed"), [(b"\x01", True), (b"\x0b", False)])
def test_a_stop_behind_half_a_megabyte_of_heavy_lines_acts_at_once(card: Wire, stop: bytes, closed: bool) -> None:
    card.tell("I200=1", "#2J/", "#2J+")
    card.sim.wait(0.5)
    card.port.receive(RANGE * 60_000 + stop)
    assert not card.port.crowded
    card.sim.attend(card.port)
    motor = card.card.motors[2]
    assert (motor.enabled, motor.jog.aborting) == (closed, closed)


def test_control_x_behind_half_a_megabyte_of_heavy_lines_empties_the_queue(card: Wire) -> None:
    card.port.receive(RANGE * 60_000)
    card.sim.attend(card.port)
    card.port.receive(b"\x18P1\r")
    card.sim.attend(card.port)
    assert card.port.take_output() == b"0\r\x06"
    assert card.port.idle


# One host that floods the card keeps nobody else from it, and nobody from stopping the machine.

FLOOD_CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine, 11 x 443 us."""

FLOOD = b"P0..1000\r" * 500


def drained(bench: Bench, seconds: float) -> bytes:
    said = b""
    for _ in range(round(seconds / FLOOD_CYCLE_S)):
        bench.sim.wait(FLOOD_CYCLE_S)
        said += bench.port.take_output()
    return said


@pytest.mark.parametrize("stop", [b"\x01", b"\x0b"])
def test_a_stop_behind_a_flood_acts_within_one_background_cycle(closed: Bench, stop: bytes) -> None:
    closed.client.request("#3J+")
    closed.sim.wait(1.0)
    motor = closed.sim.controller.motors[3]
    assert motor.velocity == pytest.approx(10.0)
    closed.port.receive(FLOOD + stop)
    closed.sim.wait(FLOOD_CYCLE_S)
    assert motor.jog.aborting if stop == b"\x01" else not motor.enabled


def test_a_stop_of_another_host_acts_before_the_lines_of_the_first(closed: Bench) -> None:
    """The flooding host is served first, and closes its loop again with its own jog."""
    other = closed.sim.connect()
    closed.port.receive(b"#3J+\r" + FLOOD)
    other.receive(b"\x0b")
    closed.sim.wait(FLOOD_CYCLE_S)
    assert [closed.sim.controller.motors[number].enabled for number in (1, 2, 3)] == [False, False, True]


def test_control_characters_act_in_their_order(closed: Bench) -> None:
    closed.raw(b"\x0b\x01")
    assert closed.lathe.snapshot().loops_closed
    closed.raw(b"\x01\x0b")
    assert not closed.lathe.snapshot().loops_closed


def test_lines_are_executed_and_answered_in_their_order(bench: Bench) -> None:
    bench.port.receive(b"".join(b"P1=%d P1\r" % number for number in range(200)))
    said = drained(bench, 200 / 4 * FLOOD_CYCLE_S + 0.05)
    assert said == b"".join(b"%d\r\x06" % number for number in range(200))


def test_a_program_typed_in_one_go_is_stored_within_a_tenth_of_a_second(bench: Bench) -> None:
    lines = ["OPEN PROG 1", "CLEAR", *(f"X{number}" for number in range(60)), "CLOSE"]
    bench.port.receive("".join(line + "\r" for line in lines).encode())
    bench.sim.wait(0.1)
    assert bench.port.take_output() == b"\x06" * len(lines)
    assert bench.client.request("LIST PROG 1") == (*lines[2:-1], "RET")


def test_a_host_with_too_much_in_the_queue_is_told_to_hold_back(bench: Bench) -> None:
    crowded = []
    for data in (b"P1\r" * (INBOX_LIMIT // 3), b"P1\r", b""):
        bench.port.receive(data)
        crowded.append(bench.port.crowded)
        bench.sim.wait(0.0 if len(crowded) < 2 else 2 * FLOOD_CYCLE_S)
    assert crowded == [False, True, False]


def test_bytes_without_an_end_of_line_do_not_pile_up(bench: Bench) -> None:
    bench.port.receive(b"x" * 10 * INBOX_LIMIT)
    bench.sim.wait(FLOOD_CYCLE_S)
    assert not bench.port.crowded
    assert bench.raw("\r") == b"\x07ERR003\r"


# Whatever a host sends, the card goes on: no byte, no line and no setting brings it down.

COMMANDS = (
    "#1J/ #2J/ #3J/ #1J+ #2J- #1J=100 #2J=-1000 #3J^50 #1J= J+ J- J/ HM #1HM #2HM #3HM K #2K A Q &1R R "
    "&1B1R B1 B2 ? ?? ??? P V F # & #1 #2 #3 #4 #8 &2 &1 #4? #4->A #4->X &2#3->X #3->0 #3->Z #1-> #1->5X+3 "
    "#2->-Y #2->Y #1->X VERSION TYPE CLOSE CLEAR LISTPROG1 LISTPROG9 DELETEPROG1 DELETEGATHER $$$ $$$*** "
    "OPENPROG1CLEAR OPENPROG2 P1=1 P1..3 P1,5,100 M26=1 Q1=P1/0 P5=SQRT(-1) P1=EXP(900) P(P1)=3 P(-1)=1 P2000 "
    "I3 I65=5 UUU J: J:5 J= J:* J^* J=* J=5^3 HMZ O5 O-200 $ $* S H / \\ %50 %0 %1000 % PC PE PR LISTPC LISTPE,9 "
    "PMATCH X=5 Z=P1 Z UNDEFINE UNDEFINEALL ##1 @ @1 @@ M5->Y:$C0,8,1 M5-> M1..9->* M6->D:$28 M6 M6=1 RX:$28 "
    "RHD:$28,9 WY:$700,1,2 SAVE SIZE PASSWORD=a ENABLEPLC1..3 DELETEALL OPENPLC1 LISTPLC1 B1.5 I100..131=* 5 -3"
).split()
SETTINGS = (
    "I8 I10 I13 I15 I100 I108 I111 I115 I116 I117 I119 I120 I121 I122 I123 I125 I126 I128 I130 I131 I133 "
    "I134 I135 I169 I187 I188 I189 I190 I211 I215 I216 I217 I219 I220 I221 I222 I223"
).split()
ANY_VALUES = "0 1 -1 0.4 0.001 3713707 8388608 999999999999 EXP(700) EXP(-700) -EXP(709)".split()
STATEMENTS = (
    "INC ABS LINEAR TA10 TA0 TS0 TS5 TM10 TM0 TM-5 F1000 F0 F-1 PVT10 PVT0 X100 Y-50 Z1 X10Y20Z30 X50:100 "
    "Y10:0 X(P1) X(EXP(700)) X1:(EXP(700)) DWELL0 DWELL5 DELAY5 DELAY0 P1=P1+1 P1=1/P2 P(0-5)=1 WHILE(1=1) "
    "ENDWHILE WHILE(P1<3) IF(P1=0) ELSE ENDIF M26=1 I187=EXP(-700) I190=EXP(-700) RAPID SPLINE1 SPLINE2 CIRCLE1 "
    'HOME1 HOMEZ2 PSETX5 STOP WAIT N1 GOTO1 GOSUB1 CALL1 RETURN G4 M3==1 FRAX(X) SENDP1 CMD"#1J+" SEND"a" CMD^A'
).split()

LINES = (
    st.lists(st.sampled_from(COMMANDS), min_size=1, max_size=4).map("".join)
    | st.builds("{}={}".format, st.sampled_from(SETTINGS), st.sampled_from(ANY_VALUES))
    | st.lists(st.sampled_from(STATEMENTS), min_size=1, max_size=6).map(
        lambda words: "\r".join(["CLOSE", "OPENPROG1CLEAR", *words, "CLOSE", "#1J/#2J/#3J/&1B1R"])
    )
    | st.text("#&?JHMKBRQA$*PVFI=+-0123456789.(){}XYZ\"'; \t", max_size=20)
)
BYTES = (
    LINES.map(lambda line: line.encode() + b"\r") | st.binary(max_size=30) | st.sampled_from([b"\x01", b"\x0b"])
)


def segments(stream: bytes, sizes: list[int]) -> list[bytes]:
    parts = []
    for size in sizes:
        parts.append(stream[:size])
        stream = stream[size:]
    return [*parts, stream]


@given(pieces=st.lists(BYTES, max_size=12), sizes=st.lists(st.integers(0, 60), max_size=8))
def test_no_bytes_bring_the_card_down(machine: MachineProfile, pieces: list[bytes], sizes: list[int]) -> None:
    sim = SimulatedLathe(machine)
    port, other = sim.connect(), sim.connect()
    for part in segments(b"".join(pieces), sizes):
        port.receive(part)
        sim.wait(0.03)
    sim.wait(1.0)
    other.receive(b"\x18\rI3=2 I6=1\r")
    sim.wait(0.006)
    assert other.take_output().endswith(b"\x06")
    port.receive(b"\x18\r")
    sim.wait(0.006)
    assert port.take_output() == b"\x06"


@given(line=LINES, sizes=st.lists(st.integers(0, 5), max_size=10))
def test_segmentation_does_not_change_an_answer(machine: MachineProfile, line: str, sizes: list[int]) -> None:
    answers = []
    for parts in (segments(line.encode() + b"\r", sizes), [line.encode() + b"\r"]):
        sim = SimulatedLathe(machine)
        port = sim.connect()
        for part in parts:
            port.receive(part)
        sim.wait(0.05)
        answers.append(port.take_output())
    assert answers[0] == answers[1]


GARBAGE = st.binary(max_size=60) | st.text(
    "JHMKBRQAPVF?#&%/\\0123456789.;\x01\x02\x03\x06\x07\x0b\x10\x16\x18\r", max_size=60
).map(str.encode)


@given(garbage=st.lists(GARBAGE, max_size=20))
def test_one_host_does_not_disturb_replies_to_another(machine: MachineProfile, garbage: list[bytes]) -> None:
    """Nothing of it can be an assignment. After a flush and an empty line its own port answers again, too."""
    sim = SimulatedLathe(machine)
    port, other = sim.connect(), sim.connect()
    other.receive(b"I3=2 I6=1 &5Q900=25 Q901=50\r")
    sim.wait(0.006)
    other.take_output()
    for part in garbage:
        port.receive(part)
        other.receive(b"Q900..9")
        sim.attend(port)
        other.receive(b"01\r")
        sim.wait(0.006)
        assert other.take_output() == b"25\r50\r\x06"
    port.receive(b"\x18\r")
    sim.attend(port)
    assert port.take_output() == b"\x06"
