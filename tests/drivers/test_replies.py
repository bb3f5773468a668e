"""Replies: how they are framed, by a line, by a board, and by long listings."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.reading import LISTING_TIMEOUT_S, ask_or_none
from drivers.errors import ControllerError, DriverError, LinkError
from drivers.link.ethernet import BoardReplies, RequestPurpose
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC
from drivers.pmac.framing import FaultKind, FramingError, Reply, ReplyReader
from tests.drivers.test_link_trace import FaultyBench as Bench
from tests.drivers.test_link_trace import Spoil
from tests.drivers.test_link_trace import bench as bench

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
    assert reader.presumed_fault is kind


def test_messages_are_taken_while_nothing_is_asked_and_half_of_one_stays() -> None:
    reader = ReplyReader()
    reader.feed(b"\x02one\r\x02two\r\x02thr")
    assert reader.take_messages() == ("one", "two")
    assert reader.within_message
    reader.feed(b"ee\r25\r\x06")
    assert reader.take() == Reply(lines=("25",), messages=("three",))
    assert reader.empty


# The replies of an Ethernet board, sorted: what is for the host, and what answers a stop.
#
# The board of these tests keeps one queue of what the card says, as the manual has it: each request fetches up
# to an ACK or LF, behind a BELL or STX up to the next CR, 1400 bytes at most, and a NUL from an empty queue.

LONGEST = 1400


class Board:
    """A board, its host, and the network between them."""

    def __init__(self) -> None:
        self.replies = BoardReplies()
        self.queue = b""
        self.wire = b""
        self.heard = b""

    def ask(self, what: RequestPurpose, answer: bytes = b"") -> None:
        self.replies.record_request(what)
        if what is RequestPurpose.FLUSH:
            self.queue, self.wire = b"", self.wire + b"@"
            return
        self.queue += answer
        piece = self.queue[: self._end()]
        self.queue = self.queue[len(piece) :]
        self.wire += piece or b"\0"

    def stop(self) -> None:
        """The CR behind the control character is an empty line, which is acknowledged."""
        self.ask(RequestPurpose.STOP, b"\x06")

    def deliver(self, count: int) -> None:
        data, self.wire = self.wire[:count], self.wire[count:]
        self.heard += self.replies.take(data)
        while not self.wire and self.replies.wants_more:
            self.ask(RequestPurpose.MORE)

    def deliver_all(self) -> bytes:
        while self.wire:
            self.deliver(len(self.wire))
        heard, self.heard = self.heard, b""
        return heard

    def _end(self) -> int:
        for place, byte in enumerate(self.queue[:LONGEST]):
            if byte in b"\x06\n":
                return place + 1
            if byte in b"\x07\x02":
                return self.queue.find(b"\r", place) + 1
        return LONGEST


def answer(lines: Iterable[int], error: int | None = None) -> bytes:
    data = b"".join(b"%d\r" % line for line in lines)
    return data + (b"\x06" if error is None else b"\x07ERR%03d\r" % error)


answers = st.builds(
    answer,
    st.one_of(st.lists(st.integers(0, 10**6), max_size=5), st.integers(0, 700).map(range)),
    st.one_of(st.none(), st.integers(0, 999)),
)


@given(st.lists(answers, min_size=1, max_size=4), st.data())
def test_each_line_gets_its_answer_and_stops_are_never_in_it(said: list[bytes], data: st.DataObject) -> None:
    board = Board()
    for expected in said:
        board.ask(RequestPurpose.LINE, expected)
        while board.wire:
            for _ in range(data.draw(st.integers(0, 2))):
                board.stop()
            board.deliver(data.draw(st.integers(1, 2000)))
        assert board.heard == expected
        assert board.replies.complete
        board.heard = b""


@pytest.mark.parametrize("length", [1398, 1399, 1400, 1401, 2799, 2800, 2801])
def test_an_answer_that_fills_replies_to_the_last_byte_is_whole(length: int) -> None:
    text = b"1" * (length - 2) + b"\r\x06"
    board = Board()
    board.ask(RequestPurpose.LINE, text)
    board.stop()
    assert board.deliver_all() == text
    assert board.replies.complete
    board.ask(RequestPurpose.LINE, b"5\r\x06")
    assert board.deliver_all() == b"5\r\x06"


def test_replies_in_one_segment_are_told_apart_before_the_rest_has_come() -> None:
    board = Board()
    board.stop()
    board.ask(RequestPurpose.LINE, b"25\r50\r\x06")
    board.stop()
    assert board.wire == b"\x0625\r50\r\x06\x06"
    assert board.deliver_all() == b"25\r50\r\x06"
    board = Board()
    board.ask(RequestPurpose.LINE, b"25\r50\r\x06")
    board.deliver(4)
    assert board.heard == b"25\r5"
    assert not board.replies.complete


def test_a_nul_is_told_and_nobody_asks_for_ever() -> None:
    board = Board()
    board.ask(RequestPurpose.LINE)
    assert board.deliver_all() == b"\0"
    assert board.replies.complete
    board = Board()
    board.ask(RequestPurpose.LINE, b"1" * 1400)
    assert board.deliver_all() == b"1" * 1400 + b"\0"
    assert board.replies.complete


@pytest.mark.parametrize("said", [b"@", b"\x18"])
def test_what_comes_before_the_end_of_a_flush_is_forgotten(said: bytes) -> None:
    replies = BoardReplies()
    for what in (RequestPurpose.LINE, RequestPurpose.STOP, RequestPurpose.FLUSH):
        replies.record_request(what)
    assert (replies.take(b"25\r\x06\x06"), replies.complete) == (b"", False)
    assert (replies.take(said), replies.complete) == (b"", True)
    replies.record_request(RequestPurpose.LINE)
    assert replies.take(b"50\r\x06") == b"50\r\x06"


def test_a_flush_sent_twice_is_waited_for_twice_and_messages_are_told() -> None:
    replies = BoardReplies()
    replies.record_request(RequestPurpose.FLUSH)
    replies.record_request(RequestPurpose.FLUSH)
    assert (replies.take(b"@1\r\x06"), replies.complete) == (b"", False)
    assert (replies.take(b"@"), replies.complete) == (b"", True)
    board = Board()
    board.ask(RequestPurpose.LINE, b"\x02PART DONE\r" + b"25\r\x06")
    assert board.wire == b"\x02PART DONE\r"
    assert board.deliver_all() == b"\x02PART DONE\r25\r\x06"
    assert BoardReplies().take(b"?") == b"?"


@pytest.mark.parametrize("said", [b"25\r\x06", b"\x07ERR003\r"])
def test_an_answer_in_the_place_of_that_to_a_stop_is_never_swallowed_in_silence(said: bytes) -> None:
    replies = BoardReplies()
    replies.record_request(RequestPurpose.STOP)
    assert replies.take(said) == b"\0"


# Listings that take their time, and those that never end: how long they are waited for, in the card's time.

LOOK_S = 0.001
"""Simulated time from one piece to the next."""

SOON_S = 20.0
"""How long `console doctor` may wait for one listing of a controller that is broken."""


def paced(said: bytes, bytes_s: float) -> list[bytes]:
    """The answer at a rate of its line."""
    gap = [b""] * round(1.0 / bytes_s / LOOK_S)
    return [piece for n in range(len(said)) for piece in (*gap, said[n : n + 1])]


def listed(client: PmacClient) -> tuple[str, ...] | None:
    return ask_or_none(client, "LIST PLC3", LISTING_TIMEOUT_S)


LINES = tuple(f"P{number}=P{number}+{number}" for number in range(101, 191))
"""1.1 kB."""


@pytest.fixture
def with_plc(bench: Bench) -> Bench:
    bench.client.download(("OPEN PLC3 CLEAR", *LINES, "CLOSE"))
    return bench


@pytest.mark.parametrize("baud_rate", [1200, 9600])
def test_a_listing_may_take_as_long_as_its_line_takes(with_plc: Bench, baud_rate: int) -> None:
    with_plc.line.spoil = lambda said: paced(said, baud_rate / 10.0)
    began_s = with_plc.sim.now_s()
    found = listed(with_plc.client)
    assert found is not None
    assert [line.strip() for line in found[: len(LINES)]] == list(LINES)
    took_s = with_plc.sim.now_s() - began_s
    assert took_s > 8.0 if baud_rate == 1200 else took_s < 2.0


BROKEN: dict[str, Spoil] = {
    "silent": lambda _: [],
    "silent in the middle": lambda said: [said[:500]],
    "a byte now and then": lambda said: paced(said, 3.0),
    "without an end": lambda _: [(b"1" * 5999 + b"\r") * 3] * 400,
    "nonsense": lambda _: [b"\xff\xfe" * 20],
}


@pytest.mark.first(2)
@pytest.mark.parametrize("bench", [PMAC], indirect=True, ids=["pmac"])
@pytest.mark.parametrize("spoil", BROKEN.values(), ids=BROKEN)
def test_a_controller_that_does_not_finish_is_not_waited_for(with_plc: Bench, spoil: Spoil) -> None:
    """It stays as it is: the way back in step is no longer than that of any other line."""
    line, began_s = with_plc.line, with_plc.sim.now_s()
    take_output = line.take_output

    def spoilt() -> bytes:
        line.spoil = spoil
        return take_output()

    line.take_output = spoilt  # type: ignore[method-assign]
    with pytest.raises(LinkError) as error:
        listed(with_plc.client)
    assert error.value.problems[0].code in ("link.not_in_step", "link.silent", "link.out_of_step")
    assert with_plc.sim.now_s() - began_s < SOON_S


def test_how_long_it_was_waited_for_is_what_is_told(with_plc: Bench) -> None:
    with_plc.line.spoil = lambda _: []
    with pytest.raises(LinkError) as error:
        with_plc.client.request("LIST PLC3", LISTING_TIMEOUT_S)
    assert error.value.problems[0].value == "5 s"


def test_over_a_lost_link_nothing_is_asked_twice(with_plc: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    from profiles.problem import Problem

    def gone(_: float) -> bytes:
        raise LinkError(Problem(code="link.closed"))

    monkeypatch.setattr(with_plc.client.link, "receive", gone)
    with_plc.line.sent.clear()
    with pytest.raises(DriverError) as error:
        listed(with_plc.client)
    assert error.value.problems[0].code == "link.closed"
    assert not any(b"P1001" in sent for sent in with_plc.line.sent)


@pytest.mark.parametrize("number", [0, 1, 19, 20, 63, 999])
def test_every_refusal_has_a_sentence_with_its_number(bench: Bench, number: int) -> None:
    from console.text.catalogue import LANGUAGES, load

    bench.line.spoil = lambda _: [b"\x07ERR%03d\r" % number]
    with pytest.raises(ControllerError) as refused:
        bench.client.request("LIST PLC5")
    (problem,) = refused.value.problems
    assert refused.value.error_number == number
    for language in LANGUAGES:
        said = load(language).problem(problem)
        assert f"ERR{number:03d}" in said and "LIST PLC5" in said
        assert problem.code not in said
