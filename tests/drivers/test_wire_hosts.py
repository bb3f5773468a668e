"""What programs of others send, the handshake that they get, checksums, addresses of cards, and fair turns."""

from __future__ import annotations

import re

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.hosts.port import LINES_PER_CYCLE, LINES_PER_TURN
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench
from tests.drivers.wire_card import CYCLE_S, Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=["pmac", "turbo"])
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    made.sim.wait(0.1)
    return made


def test_a_library_that_connects_with_one_line_needs_a_version_and_one_acknowledgement(card: Wire) -> None:
    card.raw("I3=1 I6=3\r")
    assert re.fullmatch(rb"^\d+\.\d+\s*\r\x06$", card.raw("i6=1 i3=2 ver\r"))


def test_a_library_that_ends_lines_with_cr_and_lf(card: Wire) -> None:
    assert card.raw("P1=5\r\n") == b"\x06"
    assert card.raw("P1 P2\r\n") == b"5\r0\r\x06"
    assert re.fullmatch(rb".*\x07(ERR\d{3})\r", card.raw("UUU\r\n"))
    assert card.raw("\r\n") == b"\x06"


def test_the_poll_of_a_control_panel_answers_a_line_for_each_item_and_ends_with_p99(card: Wire) -> None:
    card.tell("M190=3", "P99=0")
    lines = card.ask("i65???&1??%#1?PVFm190p99")
    assert len(lines) == 10
    assert lines[0] == "0"
    assert [len(line) for line in lines[1:3]] == [12, {8: 12, 32: 18}[len(card.card.motors)]]
    assert lines[3] == "100"
    assert len(lines[4]) == 12
    assert lines[5:] == ["0", "0", "0", "3", "0"]


def test_a_poll_of_eight_axes_in_one_line(card: Wire) -> None:
    line = "i65???&1??%" + "".join(f"#{n}?PVFm{n}90" for n in range(1, 9)) + "p99"
    lines = card.ask(line)
    assert len(lines) == 4 + 8 * 5 + 1
    assert lines[-1] == "0"


def test_forty_items_with_spaces_are_forty_lines(card: Wire) -> None:
    items = [f"{item}" for n in range(1, 9) for item in (f"#{n}?", f"#{n}P", f"#{n}F", f"M{n}31", f"P{n}00")]
    assert len(items) == 40
    assert len(card.ask(" ".join(items))) == 40


def test_flags_are_switched_with_expressions(card: Wire) -> None:
    card.tell("I9=0", "i124=0", "i124=i124|$20000")
    assert card.ask("I124") == [str(0x20000)]
    card.tell("i124=i124&$FDFFFF")
    assert card.ask("I124") == ["0"]


def test_a_driver_that_moves_with_jogs_by_its_own_settings(machine: MachineProfile) -> None:
    card = wire(machine, TURBO)
    assert card.raw("I3=2\rI4=0\r") == b"\x06\x06"
    assert len(card.ask("VERSION TYPE DATE")) == 3
    card.tell("M261->D:$000108", "M262->D:$00010B", "I219=1000 I221=0", "I222=10.5", "#2J/", "#2J:1000")
    card.settle()
    assert card.ask("#2P M262 M261") == ["1000", str(1000 * 3072), str(1000 * 3072)]
    assert card.ask("I222") == ["10.5"]


def test_a_driver_that_moves_with_programs(card: Wire) -> None:
    card.tell(
        "CLOSE", "DELETE GATHER", "OPEN PROG 10 CLEAR", "LINEAR ABS TA10 TS0 TM(Q70)", "X(Q71) Z(Q73)", "CLOSE"
    )
    card.tell("&1", "Q70=200 Q71=30 Q73=-20")
    card.tell("&1B10R")
    card.settle()
    assert card.ask("#3P") == ["-20"]
    assert card.ask("&1Q71") == ["30"]
    card.tell("&1A")


def test_blocks_of_variables_by_start_count_and_step(card: Wire) -> None:
    assert card.ask("Q53,6,1") == ["0"] * 6


def test_a_client_that_meets_an_open_buffer_closes_it_and_goes_on(card: Wire) -> None:
    other = Wire(sim=card.sim, port=card.sim.connect())
    other.tell("OPEN PROG 1 CLEAR")
    assert len(card.ask("i65???&1??%#1?PVFm190p99")) == 10
    other.tell("X10")
    card.tell("CLOSE")
    assert other.refusal("X20") == 5


def test_save_is_acknowledged(card: Wire) -> None:
    assert card.raw("SAVE\r") == b"\x06"


def test_after_a_reset_a_client_flushes_and_sets_the_link_up_again(card: Wire) -> None:
    card.raw("$$$***\r")
    card.raw("\x18I4=0\r")
    assert re.fullmatch(rb"^\d+\.\d+\s*\r\x06$", card.raw("i6=1 i3=2 ver\r"))


# What a host reads back from a port: handshake, errors, control characters, addressing.

ACK, BELL = b"\x06", b"\x07"

HANDSHAKE = {
    0: (b"", b"25\r50\r"),
    1: (b"\n", b"\n25\r\n50\r\n"),
    2: (b"\x06", b"25\r50\r\x06"),
    3: (b"\x06", b"\n25\r\n50\r\x06"),
}
"""I3: the answer to a command without data, and to one with two values (Software Reference, I3)."""


@pytest.mark.parametrize("i3", range(4))
@pytest.mark.parametrize("i6", range(4))
def test_replies_follow_i3_and_errors_follow_i6(bench: Bench, i3: int, i6: int) -> None:
    bench.client.request("P1=25 P2=50")
    silent, data = HANDSHAKE[i3]
    bench.raw(f"I3={i3} I6={i6}\r")
    assert bench.raw("P3=1\r") == silent
    assert bench.raw("P1..2\r") == data
    lead = b"\n" if i3 in (1, 3) else b""
    complaint = {0: BELL, 1: BELL + lead + b"ERR003\r", 2: BELL, 3: BELL + b"\r" + lead + b"ERR003\r"}
    assert bench.raw("UUU\r") == complaint[i6]


def test_the_line_that_sets_the_handshake_and_asks_is_answered_in_the_new_one(bench: Bench) -> None:
    bench.raw("I3=0 I6=0\r")
    assert bench.raw("i6=1 i3=2 ver\r") == b"1.17\r\x06"


def test_an_empty_line_is_acknowledged_and_case_and_spaces_do_not_matter(bench: Bench) -> None:
    assert bench.raw("\r") == ACK
    assert bench.raw("  \t \r") == ACK
    assert bench.raw("\r\r\r") == 3 * ACK
    assert bench.raw(" p 1 =5*(2 + 1)\rP1\r") == b"\x0615\r\x06"


@pytest.mark.parametrize("line", ["#1->#2->", "#1-> #2->", "#1->,#2->", "#1->&1#2->"])
def test_definitions_are_asked_for_one_after_the_other(bench: Bench, line: str) -> None:
    bench.client.request("#2->7Y+5")
    assert bench.raw(line + "\r") == b"X\r7Y+5\r\x06"


def test_a_definition_is_asked_for_in_its_system_and_in_front_of_one_that_is_made(bench: Bench) -> None:
    bench.client.request("#2->7Y+5")
    assert bench.raw("&2#2->\r#2->0\r&1#2->\r") == b"0\r\x06\x067Y+5\r\x06"
    assert bench.raw("#1->#2->7Y\r#2->\r") == b"X\r\x067Y\r\x06"


@pytest.mark.parametrize(("length", "reply"), [(255, ACK), (256, b"\x07ERR003\r"), (5000, b"\x07ERR003\r")])
def test_a_line_holds_255_characters(bench: Bench, length: int, reply: bytes) -> None:
    line = "P1=8".ljust(length - 4) + "P2=9"
    assert bench.raw(line + "\r") == reply
    assert bench.number("P1") == (8 if reply == ACK else 0)


def test_each_port_has_its_own_addressing_and_answers_only_its_own_host(bench: Bench) -> None:
    other = bench.sim.connect()
    bench.client.request("#2 &3")
    other.receive(b"#3 &2 # &\r")
    bench.sim.wait(0.011)
    assert other.take_output() == b"3\r2\r\x06"
    assert bench.client.query("#", "&") == ("2", "3")
    assert bench.port.take_output() == b""


def test_only_the_port_that_opened_a_buffer_fills_it(bench: Bench) -> None:
    other = bench.sim.connect()
    bench.client.request("OPEN PROG 1")
    other.receive(b"P1=5\rX100\rOPEN PROG 2\r")
    bench.sim.wait(0.011)
    assert other.take_output() == b"\x06\x07ERR005\r\x07ERR007\r"
    bench.client.request("P1=9")
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ("P1=9", "RET")
    assert bench.number("P1") == 5


def test_a_host_that_goes_takes_its_own_open_buffer_with_it_and_no_other(bench: Bench) -> None:
    dying = bench.sim.connect()
    dying.receive(b"OPEN PROG 5 CLEAR\rX1")
    bench.sim.wait(0.011)
    assert bench.raw("OPEN PROG 6\r") == b"\x07ERR007\r"
    bench.sim.disconnect(dying)
    assert bench.raw("OPEN PROG 6\r") == ACK
    assert bench.raw("CLOSE\r") == ACK
    passer_by = bench.sim.connect()
    bench.client.request("OPEN PROG 1 CLEAR")
    bench.sim.disconnect(passer_by)
    bench.client.request("X100")
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ("X100", "RET")


@pytest.mark.parametrize(("i3", "like"), [(0, 0), (1, 0), (2, 2), (3, 2)])
def test_i58_takes_the_line_feeds_out_of_the_handshake(bench: Bench, i3: int, like: int) -> None:
    """ASCII through the DPRAM: 1 becomes 0 and 3 becomes 2 (Software Reference, I3)."""
    bench.client.request("P1=25 P2=50")
    silent, data = HANDSHAKE[like]
    bench.raw(f"I58=1 I3={i3}\r")
    assert bench.raw("P3=1\r") == silent
    assert bench.raw("P1..2\r") == data
    assert bench.raw("UUU\r") == b"\x07ERR003\r"


# I4 and control-N: sums of characters, for hosts on noisy lines (Software Reference, I4; User Manual).


@pytest.mark.parametrize(("line", "total"), [("J+", 117), ("J/", 121)])
def test_control_n_reports_the_checksum_of_the_line_so_far(card: Wire, line: str, total: int) -> None:
    """74 + 43 and 74 + 47; one byte without an end."""
    assert card.raw(line + "\x0e") == bytes([total])
    assert card.raw(" \x18") == b""


def test_control_n_in_the_middle_of_a_line_does_not_disturb_it(card: Wire) -> None:
    assert card.raw("P1=\x0e7\r") == bytes([0x50 + 0x31 + 0x3D]) + b"\x06"
    assert card.ask("P1") == ["7"]


@pytest.mark.parametrize("i4", [0, 2])
def test_i4_even_sends_no_checksums(card: Wire, i4: int) -> None:
    assert card.raw(f"I4={i4}\rP1\r") == b"\x060\r\x06"


@pytest.mark.parametrize("i4", [1, 3])
@pytest.mark.parametrize(("i3", "handshake"), [(0, b""), (1, b"\n"), (2, b"\x06"), (3, b"\x06")])
def test_i4_odd_sends_a_checksum_behind_the_handshake(card: Wire, i4: int, i3: int, handshake: bytes) -> None:
    card.raw(f"I4={i4} I3={i3}\r")
    assert card.raw("#1J/\r") == handshake + bytes([(0x23 + 0x31 + 0x4A + 0x2F) & 0xFF])


def test_i4_odd_sends_a_checksum_behind_each_line_of_data(card: Wire) -> None:
    """Each sum is of all that was sent of the line, its CR included; the sum of the command comes last."""
    card.tell("P1=25", "P2=50")
    card.raw("I4=1\r")
    expected = b"25\r" + bytes([0x32 + 0x35 + 13]) + b"50\r" + bytes([0x35 + 0x30 + 13])
    assert card.raw("P1..2\r") == expected + b"\x06" + bytes([sum(b"P1..2") & 0xFF])


def test_a_checksum_counts_neither_control_characters_nor_errors(card: Wire) -> None:
    card.raw("I4=1\r")
    assert card.raw("P\x051\x14=3\n\r") == b"\x06" + bytes([sum(b"P1=3")])
    assert card.raw("\r") == b"\x06\x00"
    card.raw("I4=1\r")
    assert card.raw("UUU\r") == b"\x07ERR003\r"


# Several cards on one line: `@n` with bit 1 of I1 (User Manual, multiple cards).


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def chain_card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Card number 0, on a line of many."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.raw("I1=2\r")
    return made


def test_alone_on_its_line_a_card_is_always_meant(machine: MachineProfile) -> None:
    alone = wire(machine)
    assert alone.ask("@5 P1=1 P1 @") == ["1", "5"]


def test_an_address_holds_until_the_next_one_and_only_what_is_meant_for_this_card_is_done(
    chain_card: Wire,
) -> None:
    assert chain_card.raw("P1=1\rUUU\r\r@3P1=2\rP1\r") == b""
    assert chain_card.raw("@0P1\r") == b"0\r\x06"
    assert chain_card.raw("@0\rP1=4\rP1\r") == b"\x06\x064\r\x06"
    assert chain_card.raw("@1\rP1=5\r") == b"\x06"
    assert chain_card.raw("@0P1 @\r") == b"4\r0\r\x06"
    # Both programs of `@0&1B1R@1&1B7R` start with one CR, each on its card.
    assert chain_card.raw("@0P1=1@1P1=2 UUU@0P2=3\r") == b"\x06"
    assert chain_card.raw("@0P1..2\r") == b"1\r3\r\x06"


def test_two_signs_mean_every_card(chain_card: Wire) -> None:
    assert chain_card.raw("@@P1=7 P1 @\r") == b"7\r@\r\x06"


def test_the_number_of_the_card_is_i0(chain_card: Wire) -> None:
    chain_card.raw("@0I0=4\r")
    assert chain_card.raw("@0P1=1\r") == b""
    assert chain_card.raw("@4P1\r") == b"0\r\x06"


def test_003_a_number_that_no_card_can_have(chain_card: Wire) -> None:
    assert chain_card.raw("@16\r") == b"\x07ERR003\r"


def test_control_characters_act_on_every_card_unless_they_have_an_answer(chain_card: Wire) -> None:
    chain_card.raw("@0#2J/\r")
    chain_card.raw("@1\r")
    assert chain_card.raw("\x02\x03\x06\x07\x10\x16\x0b") == b""
    assert not chain_card.card.motors[2].enabled
    assert chain_card.raw("@0\r") == b"\x06"
    assert chain_card.raw("\x07") == b"000001000000\r"


# A host is answered as it asks, and none of them can keep the card for itself.


@pytest.fixture
def pmac_card(machine: MachineProfile) -> Wire:
    return wire(machine)


def test_who_waits_for_each_answer_is_never_kept_waiting(pmac_card: Wire) -> None:
    """Far more lines than a background cycle allows to a queue, and no time passes."""
    before = pmac_card.sim.now_s()
    for number in range(10 * LINES_PER_CYCLE):
        pmac_card.port.receive(b"P1=P1+1 P1\r")
        pmac_card.sim.attend(pmac_card.port)
        assert pmac_card.port.take_output() == b"%d\r\x06" % (number + 1)
    assert pmac_card.sim.now_s() == before


def test_one_turn_is_a_few_lines_of_a_queue(pmac_card: Wire) -> None:
    pmac_card.port.receive(b"P1\r" * 100)
    pmac_card.sim.attend(pmac_card.port)
    assert pmac_card.port.take_output() == b"0\r\x06" * LINES_PER_TURN
    assert pmac_card.port.ready
    assert not pmac_card.port.idle


def test_half_a_line_makes_a_port_neither_ready_nor_busy_and_long_answers_end_a_turn(pmac_card: Wire) -> None:
    """1001 values are 2003 bytes; after 4096 no further line is begun."""
    pmac_card.port.receive(b"P1=")
    pmac_card.sim.attend(pmac_card.port)
    assert (pmac_card.port.idle, pmac_card.port.ready) == (True, False)
    assert pmac_card.raw(b"1\r") == b"\x06"
    pmac_card.port.receive(b"P0..1000\r" * 4)
    pmac_card.sim.attend(pmac_card.port)
    assert len(pmac_card.port.take_output()) == 3 * 2003


def test_a_queue_has_so_many_lines_in_a_background_cycle_however_often_it_is_looked_at(pmac_card: Wire) -> None:
    pmac_card.sim.wait(CYCLE_S)
    pmac_card.port.receive(b"P1\r" * 1000)
    for _ in range(1000):
        pmac_card.sim.attend(pmac_card.port)
    assert pmac_card.port.take_output() == b"0\r\x06" * LINES_PER_CYCLE
    ready = [pmac_card.port.ready]
    pmac_card.sim.wait(CYCLE_S)
    assert [*ready, pmac_card.port.ready] == [False, True]
    assert len(pmac_card.port.take_output()) == 3 * LINES_PER_TURN


def test_a_stop_acts_before_the_lines_in_front_of_it_also_between_two_cycles(pmac_card: Wire) -> None:
    pmac_card.tell("#3J/")
    pmac_card.port.receive(b"#1J/\r" * 50 + b"\x0b")
    pmac_card.sim.attend(pmac_card.port)
    assert not pmac_card.card.motors[3].enabled


# What a tool finds out of memory about the programs of a PMAC (Software Reference, Memory Map).


def test_the_numbers_of_the_programs_and_which_plcs_are_off(machine: MachineProfile) -> None:
    card = wire(machine, PMAC)
    card.tell(
        "I5=2", "OPEN PROG 7 CLEAR", "X1", "X2", "CLOSE", "OPEN PROG 1000 CLEAR", "CLOSE", "OPEN PROG 3", "CLOSE"
    )
    assert card.ask("RX:$E00,4") == ["7 1000 3 0"]
    begins = [int(text) for text in card.ask("RY:$E00,3")[0].split()]
    assert begins == [0x1800, 0x1802, 0x1802]
    card.tell("M1->X:$E00,0,16", "M2->Y:$F03,22", "M3->Y:$F04,22")
    card.tell("OPEN PLC 3 CLEAR", "P1=P1+1", "CLOSE", "ENABLE PLC 3")
    assert card.ask("M1 M2 M3") == ["7", "0", "1"]
    card.tell("DISABLE PLC 3", "DELETE PROG 7")
    assert card.ask("M1 M2") == ["1000", "1"]


def test_on_a_turbo_these_are_plain_words(machine: MachineProfile) -> None:
    card = wire(machine, TURBO)
    card.tell("OPEN PROG 7 CLEAR", "X1", "CLOSE")
    assert card.ask("RX:$E00") == ["0"]
