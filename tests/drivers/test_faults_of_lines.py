"""Faults of lines: what they make of replies, and what a client makes of them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import LinkError, LinkTimeoutError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import REPLY_TIMEOUT_S, PmacClient
from drivers.simulator.faults.lines import (
    SPOILERS,
    OutgoingReply,
    ReplyPiece,
    as_bare_bell,
    as_nul,
    combine,
    delay_bytes,
    schedule,
    slow,
    split,
    with_empty_line,
    with_wrong_checksums,
    without_acknowledgement,
)
from drivers.simulator.hosts.port import INBOX_LIMIT
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench
from tests.drivers.wire_card import CYCLE_S, Wire, wire


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    made = wire(machine)
    made.tell("P1=25 P2=50")
    return made


def code_of(error: pytest.ExceptionInfo[LinkError]) -> str:
    return error.value.problems[0].code


@pytest.mark.parametrize(
    ("fault", "values", "refused"),
    [
        ("dropped-ack", b"25\r50\r", b"\x07ERR003\r"),
        ("extra-line", b"\r25\r50\r\x06", b"\r\x07ERR003\r"),
        ("nul", b"\0", b"\0"),
        ("bare-bel", b"\x07", b"\x07"),
        ("wrong-checksum", b"25\r50\r\x06", b"\x07ERR003\r"),
    ],
)
def test_a_spoiled_reply_byte_by_byte(card: Wire, fault: str, values: bytes, refused: bytes) -> None:
    card.sim.faults.inject(fault)
    assert card.raw("P1P2\r") == values
    assert card.raw("UUU\r") == refused
    card.sim.faults.clear()
    assert card.raw("P1P2\r") == b"25\r50\r\x06"


def test_a_wrong_checksum_is_that_of_the_data_and_that_of_the_line(card: Wire) -> None:
    """The sums of "25 CR" (0x32 + 0x35 + 0x0D = 0x74) and of "P1" (0x50 + 0x31 = 0x81)."""
    card.raw("I4=1\r")
    assert card.raw("P1\r") == b"25\r\x74\x06\x81"
    card.sim.faults.inject("wrong-checksum")
    assert card.raw("P1\r") == b"25\r\x75\x06\x82"


def test_a_reply_in_two_turns_is_spoiled_as_one(card: Wire) -> None:
    """A thousand values are more than a card gets through in one go."""
    card.tell("P0..1000=7")
    card.sim.faults.inject("bare-bel")
    card.port.receive(b"P0..1000 P0..1000 P0..1000 P0..1000\r")
    said = b""
    for _ in range(40):
        card.sim.wait(CYCLE_S)
        said += card.port.take_output()
    assert said == b"\x07"


def test_a_checksum_on_demand_is_a_reply(card: Wire) -> None:
    """Control-N, behind "P1": 0x50 + 0x31 = 0x81."""
    assert card.raw("P1\x0e") == b"\x81"
    card.raw("\x18")
    card.sim.faults.inject("nul", replies=1)
    assert card.raw("P1\x0e") == b"\0"
    assert card.sim.faults.active() != ()
    card.sim.wait(CYCLE_S)
    assert card.sim.faults.active() == ()


@pytest.mark.parametrize(
    ("fault", "untouched", "touched"), [("dropped-ack", "UUU\r", "P1\r"), ("split-segments", "P9=1\r", "P1\r")]
)
def test_only_replies_that_are_changed_count(card: Wire, fault: str, untouched: str, touched: str) -> None:
    """A refusal has no acknowledgement to lose, and one character no pieces."""
    card.sim.faults.inject(fault, replies=1)
    for _ in range(3):
        card.raw(untouched)
        card.sim.wait(CYCLE_S)
        assert len(card.sim.faults.active()) == 1
    card.raw(touched)
    card.sim.wait(CYCLE_S)
    assert card.sim.faults.active() == ()


def test_what_is_held_up_arrives_when_all_faults_are_cleared_and_what_is_silent_is_not_spoiled(card: Wire) -> None:
    card.sim.faults.inject("late-reply", delay_ms=30_000)
    assert card.raw("P1\r") == b""
    card.sim.wait(0.1)
    card.sim.faults.clear()
    card.sim.faults.inject("late-reply", delay_ms=100)
    assert card.raw("P2\r") == b"25\r\x06"
    card.sim.wait(0.11)
    assert card.port.take_output() == b"50\r\x06"
    card.sim.faults.inject("9600-baud", baud=110)
    card.port.receive(b"P1=33\r")
    card.sim.wait(0.05)
    card.sim.faults.clear()
    assert card.raw("P1\r") == b"\x0633\r\x06"
    card.raw("I3=0\r")
    card.sim.faults.inject("nul")
    assert card.raw("P3=1\r") == b""


def test_the_pieces_leave_one_after_the_other(card: Wire) -> None:
    card.sim.faults.inject("split-segments", pieces=3, gap_ms=50)
    pieces = [card.raw("P1P2\r")]
    for _ in range(40):
        card.sim.wait(CYCLE_S)
        pieces.append(card.port.take_output())
    assert [piece for piece in pieces if piece] == [b"25", b"\r5", b"0\r\x06"]


def test_a_late_reply_is_waited_for_or_told_and_flushed(bench: Bench) -> None:
    bench.client.request("P1=25")
    bench.sim.faults.inject("late-reply", delay_ms=500)
    before_s = bench.sim.now_s()
    assert bench.client.numbers("P1") == (25,)
    assert 0.5 <= bench.sim.now_s() - before_s < 0.52
    bench.client.request("P1=25 P2=50")
    bench.sim.faults.inject("late-reply", delay_ms=1000 * REPLY_TIMEOUT_S + 200, replies=1)
    with pytest.raises(LinkTimeoutError):
        bench.client.numbers("P1")
    assert bench.client.numbers("P2") == (50,)
    bench.sim.wait(0.5)
    assert bench.client.numbers("P2") == (50,)


def test_a_slow_line_takes_a_millisecond_a_character_each_way(bench: Bench) -> None:
    """ "P1 P1 ... CR" is 60 characters, its reply 20 x "7 CR" and an ACK 41; at 9600 baud 960 of them a second."""
    bench.client.request("P1=7")
    bench.sim.faults.inject("9600-baud")
    before_s = bench.sim.now_s()
    assert bench.client.numbers(*["P1"] * 20) == (7,) * 20
    assert bench.sim.now_s() - before_s == pytest.approx(101 / 960, abs=3 * CYCLE_S)


def test_a_stop_waits_behind_what_is_on_a_slow_line(closed: Bench) -> None:
    closed.sim.faults.inject("9600-baud")
    closed.port.receive(b"P1=1\r" * 96)  # half a second of line
    closed.port.receive(b"\x0b")
    closed.sim.wait(0.45)
    assert closed.sim.controller.motors[1].enabled
    closed.sim.wait(0.1)
    assert not closed.sim.controller.motors[1].enabled


def test_a_hanging_card_hears_no_stop_while_its_motors_go_on(closed: Bench) -> None:
    closed.client.request("#3J+")
    closed.sim.wait(0.5)
    motor = closed.sim.controller.motors[3]
    closed.sim.faults.inject("hang", for_s=0.5)
    where = motor.actual
    closed.port.receive(b"\x01")
    closed.sim.wait(0.49)
    assert closed.port.take_output() == b""
    assert motor.jogging
    assert abs(motor.actual - where) > 1000, "10 counts/ms, for most of half a second"
    closed.sim.wait(0.05)
    assert not motor.jogging or motor.jog.aborting, "it is heard as soon as the card reads again"


def test_the_client_is_silent_about_nothing_while_the_card_hangs(bench: Bench) -> None:
    bench.sim.faults.inject("hang", for_s=REPLY_TIMEOUT_S + 1)
    with pytest.raises(LinkTimeoutError) as silent:
        bench.client.request("P1=26")
    assert code_of(silent) == "link.silent"
    bench.sim.wait(1.5)
    bench.client.connect()
    assert bench.client.numbers("P2") == (0,)


def test_a_hanging_card_holds_back_who_floods_it(card: Wire) -> None:
    card.sim.faults.inject("hang")
    card.port.receive(b"P" * INBOX_LIMIT)
    assert card.port.crowded
    assert not card.port.ready


def test_a_cut_cable_is_a_lost_link_for_good_and_a_new_one_is_made_when_it_is_mended(bench: Bench) -> None:
    bench.client.request("P1=25")
    bench.sim.faults.inject("cut-cable", after_s=0.01, for_s=1.0)
    with pytest.raises(LinkError) as lost:
        while True:
            bench.client.numbers("P1")
            bench.sim.wait(CYCLE_S)
    assert code_of(lost) == "link.lost"
    with pytest.raises(LinkError) as refused:
        bench.sim.connect()
    assert code_of(refused) == "link.refused"
    bench.sim.wait(1.0)
    with pytest.raises(LinkError):
        bench.client.request("P1=26")
    again = PmacClient(MemoryLink(bench.sim.connect(), bench.sim), bench.sim)
    again.connect()
    assert again.numbers("P1") == (25,)


def test_a_buffer_that_was_open_is_closed_with_the_cable_that_is_cut(bench: Bench) -> None:
    bench.client.request("OPEN PROG 1 CLEAR")
    bench.sim.faults.inject("cut-cable", for_s=0.1)
    assert bench.sim.controller.open_buffer is None


@pytest.mark.parametrize("fault", ["dropped-ack", "nul", "bare-bel", "late-reply"])
def test_a_download_under_a_fault_ends_with_an_error_and_can_be_done_again(bench: Bench, fault: str) -> None:
    lines = ("CLOSE", "OPEN PROG 5", "CLEAR", "P7=1", "P7=2", "CLOSE")
    parameters = {"delay_ms": 3000} if fault == "late-reply" else {}
    bench.sim.faults.inject(fault, replies=1, **parameters)
    with pytest.raises(LinkError):
        bench.client.download(lines)
    bench.client.download(lines)
    assert bench.client.query("P1") == ("0",)


def _run(machine: MachineProfile, seed: int) -> list[bytes]:
    sim = SimulatedLathe(machine)
    card = Wire(sim=sim, port=sim.connect())
    card.raw("I3=2 I6=1\r")
    sim.faults.inject("dropped-ack", seed=seed, share=0.5)
    sim.faults.inject("extra-line", seed=seed + 1, share=0.25)
    return [card.raw("P1\r") for _ in range(60)]


def test_with_the_same_seed_the_same_share_of_replies_is_hit(machine: MachineProfile) -> None:
    run = _run(machine, 7)
    assert run == _run(machine, 7)
    assert run != _run(machine, 8)
    assert 18 <= sum(not said.endswith(b"\x06") for said in run) <= 42
    assert 5 <= sum(said.startswith(b"\r") for said in run) <= 25


def test_faults_that_are_there_together_all_have_their_effect(card: Wire) -> None:
    card.sim.faults.inject("extra-line")
    card.sim.faults.inject("dropped-ack")
    card.sim.faults.inject("late-reply", delay_ms=100)
    assert card.raw("P1\r") == b""
    card.sim.wait(0.11)
    assert card.port.take_output() == b"\r25\r"


def test_every_host_has_the_fault(card: Wire) -> None:
    other = Wire(sim=card.sim, port=card.sim.connect())
    card.sim.faults.inject("nul")
    assert (card.raw("P1\r"), other.raw("P1\r")) == (b"\0", b"\0")


def test_a_garbled_line_is_another_line_once_and_the_host_is_not_told(card: Wire) -> None:
    card.sim.faults.inject("garbled-line", find="P1=1", replace="P1=7")
    assert card.raw("P2=1\r") + card.raw("P1=10\r") == b"\x06\x06"
    assert card.raw("P1P2\r") == b"70\r1\r\x06"
    card.sim.wait(CYCLE_S)
    assert card.sim.faults.active() == ()
    card.raw("P1=1\r")
    assert card.raw("P1\r") == b"1\r\x06"


def test_what_is_garbled_may_come_in_pieces_and_grow_too_long(card: Wire) -> None:
    card.sim.faults.inject("garbled-line", find="J=1", replace="J=11")
    card.port.receive(b"#1J=")
    assert card.raw("1 P1=3" + " " * 245 + "\r") == b"\x07ERR003\r"
    assert card.raw("P1\r") == b"25\r\x06"


def test_the_checksum_of_a_garbled_line_is_that_of_what_was_read(card: Wire) -> None:
    """ "P2" is 0x50 + 0x32 = 0x82; the checksum of "50 CR" is 0x35 + 0x30 + 0x0D = 0x72."""
    card.raw("I4=1\r")
    card.sim.faults.inject("garbled-line", find="P1", replace="P2")
    assert card.raw("P1\r") == b"50\r\x72\x06\x82"
    card.sim.faults.inject("garbled-line", find="P1", replace="P2")
    assert card.raw("P1\x0e") == b"\x82"


def test_nothing_is_garbled_any_more_after_a_clear(card: Wire) -> None:
    card.sim.faults.inject("garbled-line", find="P1", replace="P2")
    card.sim.faults.clear()
    assert card.raw("P1\r") == b"25\r\x06"


# What faults make of bytes: pure functions, without a card.

VALUES = OutgoingReply(data=b"25\r50\r", end=b"\x06")
REFUSED = OutgoingReply(data=b"25\r", end=b"\x07ERR003\r")
ACCEPTED = OutgoingReply(end=b"\x06")

# The sums of "25 CR", of "CR" and of the line "P1": 0x32 + 0x35 + 0x0D = 116, 13, and 0x50 + 0x31 = 129.
SUMMED = OutgoingReply(data=b"25\r\x74\r\x0d", end=b"\x06", checksum=b"\x81", summed=True)


@pytest.mark.parametrize(
    ("reply", "left"),
    [(VALUES, b"25\r50\r"), (ACCEPTED, b""), (REFUSED, b"25\r\x07ERR003\r"), (SUMMED, b"25\r\x74\r\x0d\x81")],
)
def test_a_dropped_acknowledgement_is_that_byte_alone(reply: OutgoingReply, left: bytes) -> None:
    assert without_acknowledgement(reply).sent_bytes == left


def test_an_extra_line_is_empty_and_has_its_checksum_where_lines_have_one() -> None:
    assert with_empty_line(VALUES).sent_bytes == b"\r25\r50\r\x06"
    assert with_empty_line(REFUSED).sent_bytes == b"\r25\r\x07ERR003\r"
    assert with_empty_line(SUMMED).sent_bytes == b"\r\x0d" + SUMMED.sent_bytes


@pytest.mark.parametrize("reply", [VALUES, REFUSED, ACCEPTED, SUMMED])
def test_a_nul_and_a_bare_bell_take_the_place_of_all(reply: OutgoingReply) -> None:
    assert as_nul(reply).sent_bytes == b"\0"
    assert as_bare_bell(reply).sent_bytes == b"\x07"


def test_checksums_are_wrong_by_one_and_go_round_to_zero() -> None:
    assert with_wrong_checksums(SUMMED).sent_bytes == b"25\r\x75\r\x0e\x06\x82"
    assert with_wrong_checksums(VALUES) == VALUES
    refused = OutgoingReply(data=b"25\r\x74", end=b"\x07ERR003\r", summed=True)
    assert with_wrong_checksums(refused).sent_bytes == b"25\r\x75\x07ERR003\r"
    assert with_wrong_checksums(OutgoingReply(end=b"\x06", checksum=b"\xff", summed=True)).sent_bytes == b"\x06\0"


@given(st.binary(min_size=1, max_size=60), st.integers(2, 100), st.floats(0.001, 10.0))
def test_pieces_are_the_whole_reply_in_about_equal_parts(said: bytes, pieces: int, gap_s: float) -> None:
    parts = split(said, pieces=pieces, gap_s=gap_s)
    assert b"".join(part.data for part in parts) == said
    assert len(parts) == min(pieces, len(said))
    lengths = [len(part.data) for part in parts]
    assert max(lengths) - min(lengths) <= 1
    assert [part.gap_s for part in parts] == [0.0] + [gap_s] * (len(parts) - 1)


def test_a_slow_line_and_a_late_reply_hold_back_what_comes_behind() -> None:
    arrivals = schedule(slow(b"x" * 96, baud=9600.0), 2.0, 0.0)
    assert [data for _, data in arrivals] == [b"x"] * 96
    assert arrivals[0][0] == pytest.approx(2.0 + 10 / 9600)
    assert arrivals[-1][0] == pytest.approx(2.1)
    ((first_s, _),) = schedule(delay_bytes(b"1", delay_s=0.5), 2.0, 0.0)
    ((second_s, _),) = schedule([ReplyPiece(data=b"2")], 2.1, first_s)
    assert (first_s, second_s) == (2.5, 2.5)


@given(
    st.lists(st.tuples(st.binary(min_size=1, max_size=9), st.floats(0.0, 0.1)), max_size=8),
    st.sampled_from([110.0, 9600.0]),
)
def test_what_is_held_up_arrives_whole_and_in_order(units: list[tuple[bytes, float]], baud: float) -> None:
    now_s, last_s, arrivals = 0.0, 0.0, []
    for said, pause_s in units:
        now_s += pause_s
        pieces = combine(delay_bytes(said, delay_s=0.05), lambda part: split(part, pieces=3, gap_s=0.01))
        arrived = schedule(combine(pieces, lambda part: slow(part, baud=baud)), now_s, last_s)
        assert arrived[0][0] >= now_s + 0.05
        assert len(arrived) == len(said)
        last_s = arrived[-1][0]
        arrivals += arrived
    assert b"".join(data for _, data in arrivals) == b"".join(said for said, _ in units)
    assert [when for when, _ in arrivals] == sorted(when for when, _ in arrivals)


@pytest.mark.parametrize("name", SPOILERS)
@given(data=st.binary(max_size=20), summed=st.booleans())
def test_a_spoiled_reply_is_a_function_of_the_reply_alone(name: str, data: bytes, summed: bool) -> None:
    reply = OutgoingReply(data=data, end=b"\x06", checksum=b"\x01" if summed else b"", summed=summed)
    assert SPOILERS[name](reply) == SPOILERS[name](reply)
    # What has no checksum has none to be spoiled; everything else is seen.
    assert (SPOILERS[name](reply).sent_bytes != reply.sent_bytes) is (summed or name != "wrong-checksum")
