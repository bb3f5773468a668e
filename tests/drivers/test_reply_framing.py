"""Replies cut out of a stream: every form that I3=2 and I6=1 allow, in any segmentation."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.framing import FramingError, Reply, take_reply

TEXT = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=12)
REPLIES = st.builds(
    lambda lines, error: Reply(lines=tuple(lines), error_number=error),
    st.lists(TEXT, max_size=4),
    st.none() | st.integers(0, 999),
)


def on_the_wire(reply: Reply) -> bytes:
    """The reply as the table of the handshake prints it, written down a second time."""
    data = b"".join(line.encode() + b"\r" for line in reply.lines)
    return data + (b"\x06" if reply.error_number is None else b"\x07ERR%03d\r" % reply.error_number)


@pytest.mark.parametrize(
    ("stream", "lines", "error", "used"),
    [
        (b"\x06", (), None, 1),
        (b"25\r\x06", ("25",), None, 4),
        (b"25\r50\r75\r\x06", ("25", "50", "75"), None, 10),
        (b"\r\x06", ("",), None, 2),
        (b"\x07ERR003\r", (), 3, 8),
        (b"25\r\x07ERR016\r", ("25",), 16, 11),
        (b"\x06\x06", (), None, 1),
        (b"25\r\n\x06", None, None, None),
        (b"\n25\r\n50\r\x06", ("25", "50"), None, 9),
    ],
)
def test_each_form_of_a_reply(
    stream: bytes, lines: tuple[str, ...] | None, error: int | None, used: int | None
) -> None:
    if lines is None:
        with pytest.raises(FramingError):
            take_reply(stream)
        return
    assert take_reply(stream) == (Reply(lines=lines, error_number=error), used)


@pytest.mark.parametrize("part", [b"", b"2", b"25\r", b"25\r50", b"\x07", b"\x07ERR0", b"25\r\x07ERR003"])
def test_an_incomplete_reply_is_waited_for(part: bytes) -> None:
    assert take_reply(part) == (None, 0)


@pytest.mark.parametrize(
    "garbage",
    [
        b"25\x06",
        b"\x00",
        b"2\x00\r\x06",
        b"\xff\x06",
        b"\x7f",
        b"\x07\r",
        b"\x07ERR\r",
        b"\x07ERR03\r",
        b"\x07ERR0003\r",
        b"\x07err003\r",
        b"\x07ERR-03\r",
        b"\x07 ERR03\r",
        b"7\x07ERR003\r",
    ],
)
def test_bytes_that_no_controller_sends_are_out_of_step(garbage: bytes) -> None:
    with pytest.raises(FramingError):
        take_reply(garbage)


@given(replies=st.lists(REPLIES, max_size=5), cuts=st.lists(st.integers(0, 200), max_size=12))
def test_any_segmentation_of_a_stream_gives_the_same_replies(replies: list[Reply], cuts: list[int]) -> None:
    stream = b"".join(on_the_wire(reply) for reply in replies)
    places = sorted({0, len(stream), *(cut for cut in cuts if cut < len(stream))})
    buffer, found = b"", []
    for start, end in pairwise(places):
        buffer += stream[start:end]
        while True:
            reply, used = take_reply(buffer)
            buffer = buffer[used:]
            if reply is None:
                assert used == 0
                break
            found.append(reply)
    assert found == replies
    assert buffer == b""


@given(st.binary(max_size=60) | st.text("\x06\x07\r\nER0123\x00", max_size=40).map(str.encode))
def test_garbage_is_a_reply_or_unfinished_or_a_framing_error_and_nothing_else(stream: bytes) -> None:
    try:
        reply, used = take_reply(stream)
    except FramingError:
        return
    assert 0 <= used <= len(stream)
    assert (reply is None) == (used == 0)
    if reply is not None:
        assert stream[used - 1] in b"\x06\r"
