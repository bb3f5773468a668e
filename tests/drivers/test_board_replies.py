"""The replies of an Ethernet board, sorted: what is for the host, and what answers a stop.

The board of these tests keeps one queue of what the card says, as the manual has it: each request fetches up to an
ACK or LF, behind a BELL or STX up to the next CR, 1400 bytes at most, and a NUL from an empty queue.
"""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.link.ethernet import Asked, BoardReplies

LONGEST = 1400


class Board:
    """A board, its host, and the network between them."""

    def __init__(self) -> None:
        self.replies = BoardReplies()
        self.queue = b""
        self.wire = b""
        self.heard = b""

    def ask(self, what: Asked, answer: bytes = b"") -> None:
        self.replies.asked(what)
        if what is Asked.FLUSH:
            self.queue, self.wire = b"", self.wire + b"@"
            return
        self.queue += answer
        piece = self.queue[: self._end()]
        self.queue = self.queue[len(piece) :]
        self.wire += piece or b"\0"

    def stop(self) -> None:
        """The CR behind the control character is an empty line, which is acknowledged."""
        self.ask(Asked.STOP, b"\x06")

    def deliver(self, count: int) -> None:
        data, self.wire = self.wire[:count], self.wire[count:]
        self.heard += self.replies.take(data)
        while not self.wire and self.replies.wants_more:
            self.ask(Asked.MORE)

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
        board.ask(Asked.LINE, expected)
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
    board.ask(Asked.LINE, text)
    board.stop()
    assert board.deliver_all() == text
    assert board.replies.complete
    board.ask(Asked.LINE, b"5\r\x06")
    assert board.deliver_all() == b"5\r\x06"


def test_several_replies_in_one_segment_are_told_apart() -> None:
    board = Board()
    board.stop()
    board.ask(Asked.LINE, b"25\r50\r\x06")
    board.stop()
    assert board.wire == b"\x0625\r50\r\x06\x06"
    assert board.deliver_all() == b"25\r50\r\x06"


def test_what_has_come_is_told_before_the_rest_of_it() -> None:
    board = Board()
    board.ask(Asked.LINE, b"25\r50\r\x06")
    board.deliver(4)
    assert board.heard == b"25\r5"
    assert not board.replies.complete


def test_a_nul_is_told_and_ends_the_line_that_it_answers() -> None:
    board = Board()
    board.ask(Asked.LINE)
    assert board.deliver_all() == b"\0"
    assert board.replies.complete


def test_a_nul_behind_a_part_of_an_answer_is_told_and_nobody_asks_for_ever() -> None:
    board = Board()
    board.ask(Asked.LINE, b"1" * 1400)
    assert board.deliver_all() == b"1" * 1400 + b"\0"
    assert board.replies.complete


@pytest.mark.parametrize("said", [b"@", b"\x18"])
def test_what_comes_before_the_end_of_a_flush_is_forgotten(said: bytes) -> None:
    replies = BoardReplies()
    for what in (Asked.LINE, Asked.STOP, Asked.FLUSH):
        replies.asked(what)
    assert (replies.take(b"25\r\x06\x06"), replies.complete) == (b"", False)
    assert (replies.take(said), replies.complete) == (b"", True)
    replies.asked(Asked.LINE)
    assert replies.take(b"50\r\x06") == b"50\r\x06"


def test_a_flush_that_was_sent_twice_is_waited_for_twice() -> None:
    replies = BoardReplies()
    replies.asked(Asked.FLUSH)
    replies.asked(Asked.FLUSH)
    assert (replies.take(b"@1\r\x06"), replies.complete) == (b"", False)
    assert (replies.take(b"@"), replies.complete) == (b"", True)


def test_a_message_of_a_program_is_told_and_the_answer_behind_it_is_fetched() -> None:
    board = Board()
    board.ask(Asked.LINE, b"\x02PART DONE\r" + b"25\r\x06")
    assert board.wire == b"\x02PART DONE\r"
    assert board.deliver_all() == b"\x02PART DONE\r25\r\x06"


@pytest.mark.parametrize("said", [b"25\r\x06", b"\x07ERR003\r"])
def test_an_answer_in_the_place_of_that_to_a_stop_is_never_swallowed_in_silence(said: bytes) -> None:
    replies = BoardReplies()
    replies.asked(Asked.STOP)
    assert replies.take(said) == b"\0"


def test_what_nobody_asked_for_is_told() -> None:
    assert BoardReplies().take(b"?") == b"?"
