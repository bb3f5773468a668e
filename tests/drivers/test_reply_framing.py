"""Replies cut out of a stream: every form that I3=2 and I6=1 allow, in any segmentation."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.framing import FaultKind, FramingError, Reply, ReplyReader

TEXT = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=12)
REPLIES = st.builds(
    lambda lines, error, messages: Reply(lines=tuple(lines), error_number=error, messages=tuple(messages)),
    st.lists(TEXT, max_size=4),
    st.none() | st.integers(0, 999),
    st.lists(TEXT, max_size=2),
)


def take_reply(buffer: bytes) -> tuple[Reply | None, int]:
    """Return the first complete reply in `buffer` and the number of bytes that it takes (0 while incomplete)."""
    reader = ReplyReader()
    reader.feed(buffer)
    reply = reader.take()
    return reply, 0 if reply is None else len(buffer) - len(reader.rest)


def on_the_wire(reply: Reply) -> bytes:
    """The reply as the table of the handshake prints it, written down a second time."""
    said = b"".join(b"\x02" + text.encode() + b"\r" for text in reply.messages)
    data = said + b"".join(line.encode() + b"\r" for line in reply.lines)
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


@given(replies=st.lists(REPLIES, max_size=5), cuts=st.lists(st.integers(0, 200), max_size=12))
def test_a_reader_that_is_fed_piece_by_piece_finds_the_same(replies: list[Reply], cuts: list[int]) -> None:
    stream = b"".join(on_the_wire(reply) for reply in replies)
    places = sorted({0, len(stream), *(cut for cut in cuts if cut < len(stream))})
    reader, found = ReplyReader(), []
    for start, end in pairwise(places):
        reader.feed(stream[start:end])
        while (reply := reader.take()) is not None:
            found.append(reply)
    assert found == replies
    assert reader.empty


@given(reply=REPLIES, place=st.integers(0, 6), text=TEXT)
def test_a_message_between_any_two_lines_of_a_reply_is_no_data(reply: Reply, place: int, text: str) -> None:
    lines = on_the_wire(reply).split(b"\r")
    place = min(place, len(lines) - 1)
    wire = b"\r".join([*lines[:place], b"\x02" + text.encode(), *lines[place:]])
    found, used = take_reply(wire)
    if reply.error_number is not None and place == len(lines) - 1:
        assert found == reply, "behind its end it belongs to the next one"
        return
    assert found is not None
    assert (found.lines, found.error_number, used) == (reply.lines, reply.error_number, len(wire))
    assert sorted(found.messages) == sorted([*reply.messages, text])


@pytest.mark.parametrize(
    ("stream", "kind"),
    [
        (b"\0", FaultKind.NUL),
        (b"25\r\0", FaultKind.NUL),
        (b"\x07\r", FaultKind.HANDSHAKE),
        (b"25\r\x74\x06\x81", FaultKind.GARBLED),
        (b"25\r\x9b", FaultKind.GARBLED),
        (b"\x18", FaultKind.GARBLED),
        (b"\x02a\x06", FaultKind.GARBLED),
    ],
)
def test_what_is_no_reply_has_a_kind(stream: bytes, kind: FaultKind) -> None:
    with pytest.raises(FramingError) as met:
        take_reply(stream)
    assert met.value.kind is kind


@pytest.mark.parametrize(
    ("stream", "kind"),
    [
        (b"\x07", FaultKind.BARE_BELL),
        (b"25\r\x07", FaultKind.BARE_BELL),
        (b"\n", FaultKind.HANDSHAKE),
        (b"\n25\r\n", FaultKind.HANDSHAKE),
        (b"", None),
        (b"25\r", None),
        (b"2", None),
        (b"\x07ERR", None),
        (b"\x02hel", None),
    ],
)
def test_what_would_be_no_reply_if_nothing_more_came(stream: bytes, kind: FaultKind | None) -> None:
    """I6 = 0 or 2 words an error as a BEL, I3 = 1 ends data with a line feed (Software Reference)."""
    reader = ReplyReader()
    reader.feed(stream)
    assert reader.take() is None
    assert reader.presumed is kind


def test_messages_are_taken_while_nothing_is_asked_and_half_of_one_stays() -> None:
    reader = ReplyReader()
    reader.feed(b"\x02one\r\x02two\r\x02thr")
    assert reader.take_messages() == ("one", "two")
    assert reader.within_message
    reader.feed(b"ee\r25\r\x06")
    assert reader.take() == Reply(lines=("25",), messages=("three",))
    assert reader.empty
