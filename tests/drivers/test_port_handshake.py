"""What a host reads back from a port: handshake, errors, control characters, addressing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

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
    complaint = {
        0: BELL,
        1: BELL + lead + b"ERR003\r",
        2: BELL,
        3: BELL + b"\r" + lead + b"ERR003\r",
    }
    assert bench.raw("UUU\r") == complaint[i6]


def test_a_card_from_the_factory_answers_with_line_feeds_and_long_errors(bench: Bench) -> None:
    bench.raw("$$$***\r")
    assert bench.raw("P1\r") == b"\n0\r\n"
    assert bench.raw("UUU\r") == b"\x07\r\nERR003\r"


def test_the_line_that_sets_the_handshake_and_asks_is_answered_in_the_new_one(bench: Bench) -> None:
    bench.raw("I3=0 I6=0\r")
    assert bench.raw("i6=1 i3=2 ver\r") == b"1.17\r\x06"


def test_the_transcript_of_the_manual(bench: Bench) -> None:
    bench.client.request("P1=25 P2=50 P3=75")
    assert bench.raw("#1J/\r") == ACK
    assert bench.raw("UUU\r") == b"\x07ERR003\r"
    assert bench.raw("P1..3\r") == b"25\r50\r75\r\x06"


def test_an_empty_line_is_acknowledged(bench: Bench) -> None:
    assert bench.raw("\r") == ACK
    assert bench.raw("  \t \r") == ACK
    assert bench.raw("\r\r\r") == 3 * ACK


def test_a_line_feed_behind_the_carriage_return_is_nothing(bench: Bench) -> None:
    assert bench.raw("P1=7\r\nP1\r\n") == b"\x067\r\x06"


def test_case_and_spaces_do_not_matter(bench: Bench) -> None:
    assert bench.raw(" p 1 =5*(2 + 1)\rP1\r") == b"\x0615\r\x06"


@pytest.mark.parametrize(
    ("line", "values"), [("#5P7#2#3#", 2), ("I65???&1??#1?PVFM190P99", 9), ("#1P#2P#3P&2&", 4)]
)
def test_commands_need_no_separators(bench: Bench, line: str, values: int) -> None:
    """A poll as clients in the field send it; P7 is a variable, and the motor speaks when its letter is bare."""
    bench.client.request("P7=0")
    reply = bench.raw(line + "\r")
    assert reply.endswith(ACK)
    assert reply.count(b"\r") == values


@pytest.mark.parametrize("line", ["#1->#2->", "#1-> #2->", "#1->,#2->", "#1->&1#2->"])
def test_definitions_are_asked_for_one_after_the_other(bench: Bench, line: str) -> None:
    bench.client.request("#2->7Y+5")
    assert bench.raw(line + "\r") == b"X\r7Y+5\r\x06"


def test_a_motor_has_no_definition_in_the_other_systems_and_none_to_clear_there(bench: Bench) -> None:
    bench.client.request("#2->7Y+5")
    assert bench.raw("&2#2->\r#2->0\r&1#2->\r") == b"0\r\x06\x067Y+5\r\x06"


def test_a_definition_is_asked_for_in_front_of_one_that_is_made(bench: Bench) -> None:
    assert bench.raw("#1->#2->7Y\r#2->\r") == b"X\r\x067Y\r\x06"


def test_the_poll_without_separators_is_taken_apart_in_order(bench: Bench) -> None:
    bench.client.request("M190=3 P99=0 I65=12")
    lines = bench.raw("i65???&1??#1?PVFm190p99\r").removesuffix(b"\r\x06").split(b"\r")
    assert lines[0] == b"12"
    assert [len(line) for line in lines[1:4]] == [12, 12, 12]
    assert lines[4:] == [b"0", b"0", b"0", b"3", b"0"]


def test_ranges_and_start_count_step(bench: Bench) -> None:
    assert bench.raw("Q53..55=2 Q53,3,1=7 Q54=1\r") == ACK
    assert bench.raw("Q53,3,1\r") == b"7\r1\r7\r\x06"
    assert bench.raw("I5..3\r") == b"\x07ERR003\r"


def test_expressions_are_calculated_by_the_rules_of_the_language(bench: Bench) -> None:
    bench.client.request("P1=2 I130=$10 P2=I130|$20000 P3=1.25*I130 P4=SIN(30) P5=2+3*4")
    assert bench.client.numbers("P2", "P3", "P4", "P5") == (0x20010, 20, 0.5, 14)


def test_data_of_the_commands_before_an_error_precede_the_bell_and_the_rest_is_not_done(bench: Bench) -> None:
    bench.client.request("P1=25 P2=1")
    assert bench.raw("P1 P1=26 CLEAR P2=99\r") == b"25\r\x07ERR005\r"
    assert bench.client.numbers("P1", "P2") == (26, 1)


def test_a_control_character_acts_in_the_middle_of_a_line_and_does_not_disturb_it(bench: Bench) -> None:
    bench.lathe.enable()
    assert bench.raw("P1=4\x0b2\r") == ACK
    assert bench.number("P1") == 42
    assert not bench.lathe.snapshot().loops_closed


def test_backspace_takes_the_last_character_back(bench: Bench) -> None:
    bench.raw("\x08P1=457\x08\x086\r")
    assert bench.number("P1") == 46


def test_control_x_empties_the_line_and_what_was_to_be_said(bench: Bench) -> None:
    assert bench.raw("P1\rP1=") == b"0\r\x06"
    assert bench.raw("P1\rP2\rP1=12\x18P3\r") == b"0\r\x06"
    assert bench.number("P1") == 0


@pytest.mark.parametrize(("length", "reply"), [(255, ACK), (256, b"\x07ERR003\r"), (5000, b"\x07ERR003\r")])
def test_a_line_holds_255_characters(bench: Bench, length: int, reply: bytes) -> None:
    line = "P1=8".ljust(length - 4) + "P2=9"
    assert bench.raw(line + "\r") == reply
    assert bench.number("P1") == (8 if reply == ACK else 0)


def test_a_character_beyond_ascii_is_illegal(bench: Bench) -> None:
    assert bench.raw(b"P1=1\xb5\r") == b"\x07ERR004\r"
    assert bench.number("P1") == 0


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


def test_a_host_that_dies_with_an_open_buffer_harms_nobody(bench: Bench) -> None:
    dying = bench.sim.connect()
    dying.receive(b"OPEN PROG 5 CLEAR\rX1")
    bench.sim.wait(0.011)
    assert bench.raw("OPEN PROG 6\r") == b"\x07ERR007\r"
    bench.sim.disconnect(dying)
    assert bench.raw("OPEN PROG 6\r") == ACK
    assert bench.raw("CLOSE\r") == ACK


def test_a_host_that_goes_leaves_the_buffer_of_another_open(bench: Bench) -> None:
    passer_by = bench.sim.connect()
    bench.client.request("OPEN PROG 1 CLEAR")
    bench.sim.disconnect(passer_by)
    bench.client.request("X100")
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ("X100", "RET")


def test_a_stored_line_goes_into_the_buffer_and_is_not_executed(bench: Bench) -> None:
    bench.client.request("P1=1 OPEN PROG 1 CLEAR")
    bench.client.request("P1=2 ; a remark \xe9")
    assert bench.raw("P1\r") == b"\x07ERR003\r"
    bench.client.request("X10 Y20 CLOSE")
    assert bench.number("P1") == 1
    assert bench.client.request("LIST PROG 1") == ("P1=2", "X10Y20", "RET")


@pytest.mark.parametrize(("i3", "like"), [(0, 0), (1, 0), (2, 2), (3, 2)])
def test_i58_takes_the_line_feeds_out_of_the_handshake(bench: Bench, i3: int, like: int) -> None:
    """ASCII through the DPRAM: 1 becomes 0 and 3 becomes 2 (Software Reference, I3)."""
    bench.client.request("P1=25 P2=50")
    silent, data = HANDSHAKE[like]
    bench.raw(f"I58=1 I3={i3}\r")
    assert bench.raw("P3=1\r") == silent
    assert bench.raw("P1..2\r") == data
    assert bench.raw("UUU\r") == b"\x07ERR003\r"
