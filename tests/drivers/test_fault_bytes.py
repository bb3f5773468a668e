"""What faults make of bytes: pure functions, without a card."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.simulator.faults.lines import (
    SPOILERS,
    Piece,
    Reply,
    as_bare_bell,
    as_nul,
    combine,
    late,
    schedule,
    slow,
    split,
    with_empty_line,
    with_wrong_checksums,
    without_acknowledgement,
)

VALUES = Reply(data=b"25\r50\r", end=b"\x06")
REFUSED = Reply(data=b"25\r", end=b"\x07ERR003\r")
ACCEPTED = Reply(end=b"\x06")

# The sums of "25 CR", of "CR" and of the line "P1": 0x32 + 0x35 + 0x0D = 116, 13, and 0x50 + 0x31 = 129.
SUMMED = Reply(data=b"25\r\x74\r\x0d", end=b"\x06", checksum=b"\x81", summed=True)


@pytest.mark.parametrize(
    ("reply", "left"),
    [(VALUES, b"25\r50\r"), (ACCEPTED, b""), (REFUSED, b"25\r\x07ERR003\r"), (SUMMED, b"25\r\x74\r\x0d\x81")],
)
def test_a_dropped_acknowledgement_is_that_byte_alone(reply: Reply, left: bytes) -> None:
    assert without_acknowledgement(reply).sent == left


def test_an_extra_line_is_empty_and_has_its_checksum_where_lines_have_one() -> None:
    assert with_empty_line(VALUES).sent == b"\r25\r50\r\x06"
    assert with_empty_line(REFUSED).sent == b"\r25\r\x07ERR003\r"
    assert with_empty_line(SUMMED).sent == b"\r\x0d" + SUMMED.sent


@pytest.mark.parametrize("reply", [VALUES, REFUSED, ACCEPTED, SUMMED])
def test_a_nul_and_a_bare_bell_take_the_place_of_all(reply: Reply) -> None:
    assert as_nul(reply).sent == b"\0"
    assert as_bare_bell(reply).sent == b"\x07"


def test_every_checksum_is_wrong_by_one_and_nothing_else_is_touched() -> None:
    assert with_wrong_checksums(SUMMED).sent == b"25\r\x75\r\x0e\x06\x82"
    assert with_wrong_checksums(VALUES) == VALUES
    refused = Reply(data=b"25\r\x74", end=b"\x07ERR003\r", summed=True)
    assert with_wrong_checksums(refused).sent == b"25\r\x75\x07ERR003\r"


def test_the_highest_checksum_goes_round_to_zero() -> None:
    assert with_wrong_checksums(Reply(end=b"\x06", checksum=b"\xff", summed=True)).sent == b"\x06\0"


@given(st.binary(min_size=1, max_size=60), st.integers(2, 100), st.floats(0.001, 10.0))
def test_pieces_are_the_whole_reply_in_about_equal_parts(said: bytes, pieces: int, gap_s: float) -> None:
    parts = split(said, pieces=pieces, gap_s=gap_s)
    assert b"".join(part.data for part in parts) == said
    assert len(parts) == min(pieces, len(said))
    lengths = [len(part.data) for part in parts]
    assert max(lengths) - min(lengths) <= 1
    assert [part.gap_s for part in parts] == [0.0] + [gap_s] * (len(parts) - 1)


def test_at_9600_baud_96_characters_take_a_tenth_of_a_second() -> None:
    arrivals = schedule(slow(b"x" * 96, baud=9600.0), 2.0, 0.0)
    assert [data for _, data in arrivals] == [b"x"] * 96
    assert arrivals[0][0] == pytest.approx(2.0 + 10 / 9600)
    assert arrivals[-1][0] == pytest.approx(2.1)


def test_what_is_sent_behind_a_late_reply_does_not_overtake_it() -> None:
    ((first_s, _),) = schedule(late(b"1", delay_s=0.5), 2.0, 0.0)
    ((second_s, _),) = schedule([Piece(data=b"2")], 2.1, first_s)
    assert (first_s, second_s) == (2.5, 2.5)


@given(
    st.lists(st.tuples(st.binary(min_size=1, max_size=9), st.floats(0.0, 0.1)), max_size=8),
    st.sampled_from([110.0, 9600.0]),
)
def test_whatever_holds_it_up_it_arrives_whole_in_its_order_and_not_before_it_was_sent(
    units: list[tuple[bytes, float]], baud: float
) -> None:
    now_s, last_s, arrivals = 0.0, 0.0, []
    for said, pause_s in units:
        now_s += pause_s
        pieces = combine(late(said, delay_s=0.05), lambda part: split(part, pieces=3, gap_s=0.01))
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
    reply = Reply(data=data, end=b"\x06", checksum=b"\x01" if summed else b"", summed=summed)
    assert SPOILERS[name](reply) == SPOILERS[name](reply)
    # What has no checksum has none to be spoiled; everything else is seen.
    assert (SPOILERS[name](reply).sent != reply.sent) is (summed or name != "wrong-checksum")
