"""Requests of other threads, sent by the thread of the link between two polls; and a record of what went over it.

A worker thread asks and waits; the link thread serves after each poll: several requests at rest, for a part of the
time between two polls; one short request in motion, as a batch of a cut is fetched; none while an axis homes or a
stop is being proven. The watchdog is renewed with the poll. Every line is judged again here, so that no fault of a
worker sends anything that could move something.

The record is for an engineer who wants to see what a key of the console sends. The link's threads append, a signal
handler among them; a screen reads. Polls come ten times a second and would push everything else out, so they are
kept apart.
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from queue import Empty, SimpleQueue

from drivers.clock import Clock
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.link.base import Link
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import expected_replies
from drivers.requests.permitted_lines import RequestKind, gathers, permission
from profiles.problem import Problem, ProblemError

ANSWER_S = 0.17  # reply timeout in motion, as for a poll under a watchdog
REST_TIMEOUT_S = 2.0  # of a short query at rest
LISTING_S = 10.0  # of a listing at rest; a longer one is not asked for
AT_REST_S = 0.1  # time for requests after one poll at rest
NEXT_S = 0.02  # how long the next request of a worker is waited for at rest
SLICE_S = 0.1
ASK_S = 20.0  # after which a worker gives up: nobody polls any more

Lines = tuple[str, ...]
KEPT, POLLS_KEPT = 3000, 120  # pieces: a request and its reply are two or more
SENT, RECEIVED, STOP, FAILED = ">", "<", "!", "*"


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestConditions:
    """What the next requests are judged by. `homing`: an axis seeks its switch; `stopping`: rest is not proven."""

    at_rest: bool
    controls: bool
    homing: bool = False
    stopping: bool = False
    lost: bool = False


class CancelledError(Exception):
    """The worker was asked to end."""


@dataclass(eq=False)
class SideRequest:
    """One request, and its answer."""

    line: str
    kind: RequestKind
    lines: int | None
    timeout_s: float
    answer: SimpleQueue[Lines | BaseException] = field(default_factory=SimpleQueue)
    dropped: bool = False


@dataclass(frozen=True, slots=True)
class TrafficPiece:
    """Bytes in one direction, in order `number`; `mark` as in a trace."""

    number: int
    at_s: float
    mark: str
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class TrafficLine:
    """One line of the list: a request with its data, a stop, or a failure, the text with its control characters.

    `number` is that of its last piece, `poll` whether it is a status poll.
    """

    number: int
    at_s: float
    mark: str
    text: str
    poll: bool


class LineTraffic:
    """The newest pieces. A line that ends with `poll_line` is a status poll."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self.poll_line = b""
        self.began_s = now_s()
        self._now_s = now_s
        self._kept: deque[TrafficPiece] = deque(maxlen=KEPT)
        self._polls: deque[TrafficPiece] = deque(maxlen=POLLS_KEPT)
        self._numbers = itertools.count(1)
        self._target = self._kept

    def tap(self, mark: str, data: bytes) -> None:
        """Take bytes as they pass; returns at once, never raises."""
        if mark == SENT:
            self._target = self._polls if self._polls_with(data) else self._kept
        target = self._target if mark in (SENT, RECEIVED) else self._kept
        target.append(TrafficPiece(next(self._numbers), self._now_s(), mark, data))

    def _polls_with(self, data: bytes) -> bool:
        return bool(self.poll_line) and data.rstrip(b"\r").endswith(self.poll_line)

    def newest(self, *, polls: bool) -> int:
        """Return the number of the newest piece, with the status polls or without; 0 before the first."""
        kept = (self._kept, self._polls) if polls else (self._kept,)
        return max((pieces[-1].number for pieces in kept if pieces), default=0)

    def list_traffic(self, *, polls: bool) -> tuple[TrafficLine, ...]:
        """Return what went over the link in its order, with the status polls or without."""
        kept = [(piece, False) for piece in _copy_pieces(self._kept)]
        if polls:
            kept += [(piece, True) for piece in _copy_pieces(self._polls)]
            kept.sort(key=lambda each: each[0].number)
        return tuple(_join_pieces(kept))


def _copy_pieces(pieces: deque[TrafficPiece]) -> list[TrafficPiece]:
    """Return a copy, safe against entries appended meanwhile."""
    while True:
        try:
            return list(pieces)
        except RuntimeError:
            continue


def _join_pieces(pieces: list[tuple[TrafficPiece, bool]]) -> list[TrafficLine]:
    """Join pieces of one direction: a line goes out in parts where the link paces it, and comes in as many."""
    found: list[TrafficLine] = []
    for piece, poll in pieces:
        text = piece.data.decode("latin-1")
        last = found[-1] if found else None
        joins = last is not None and piece.mark in (SENT, RECEIVED) and last.mark == piece.mark
        if last is not None and joins and last.poll == poll and not last.text.endswith(_ENDS[piece.mark]):
            found[-1] = replace(last, number=piece.number, text=last.text + text)
        else:
            found.append(TrafficLine(number=piece.number, at_s=piece.at_s, mark=piece.mark, text=text, poll=poll))
    return found


_ENDS = {SENT: ("\r",), RECEIVED: ("\x06",)}


class SideLine:
    """Passes the requests of worker threads to the thread of the link."""

    def __init__(
        self, client: PmacClient, clock: Clock, heard: LineTraffic, stopped: Callable[[], bool] = lambda: False
    ) -> None:
        """`heard` has what went over the link; `stopped` returns whether a stop is in force."""
        self.heard = heard
        self._client, self._clock, self._stopped = client, clock, stopped
        self._waiting: SimpleQueue[SideRequest] = SimpleQueue()
        self._lock = threading.Lock()
        self._working = self._readings = 0

    @property
    def link(self) -> Link:
        """The link: for its address, and how a stop goes."""
        return self._client.link

    @property
    def dialect(self) -> Dialect:
        """The family of the controller. Raises RefusedError: `link.not_connected`."""
        return self._client.dialect

    @property
    def faults(self) -> int:
        """Link faults so far."""
        return self._client.faults.total

    @property
    def line_check(self) -> object:
        """What verifies that a line that moves something arrives as it was sent."""
        return self._client.line_check

    @property
    def pending(self) -> int:
        """How many requests wait to be sent."""
        return self._waiting.qsize()

    @property
    def reading(self) -> bool:
        """Whether the configuration is being read: no motion begins meanwhile."""
        return self._readings > 0

    @contextmanager
    def working(self, *, reading: bool = False) -> Iterator[None]:
        """Mark that a worker is about to ask again and again."""
        with self._lock:
            self._working += 1
            self._readings += reading
        try:
            yield
        finally:
            with self._lock:
                self._working -= 1
                self._readings -= reading

    def ask(self, asked: SideRequest, cancelled: Callable[[], bool] = lambda: False) -> Lines:
        """Return the reply to a line; for a worker thread, which waits.

        Raises:
            CancelledError: the worker was asked to end; the line is not sent.
            RefusedError: the line is not permitted now.
            LinkError: `beside.silent`, nobody polls; or as `PmacClient.request`.
        """
        self._waiting.put(asked)
        waited_s = 0.0
        while True:
            try:
                answer = asked.answer.get(timeout=SLICE_S)
            except Empty:
                waited_s += SLICE_S
                if cancelled():
                    asked.dropped = True
                    raise CancelledError from None
                if waited_s > ASK_S + asked.timeout_s:
                    asked.dropped = True
                    raise LinkError(Problem(code="beside.silent", where=self.link.address)) from None
                continue
            if isinstance(answer, BaseException):
                raise answer
            if cancelled():
                raise CancelledError
            return answer

    def serve(self, now: RequestConditions) -> None:
        """Send what waits, as far as this moment permits. For the thread of the link; never raises."""
        if now.homing or (now.stopping and not now.lost):
            return
        until_s = self._clock.now_s() + AT_REST_S
        may_wait = False
        while (asked := self._next(NEXT_S if may_wait else 0.0)) is not None:
            asked.answer.put(self._answer_request(asked, now))
            may_wait = now.at_rest and self._working > 0
            if not now.at_rest or self._stopped() or self._clock.now_s() >= until_s:
                return

    def _next(self, wait_s: float) -> SideRequest | None:
        while True:
            try:
                asked = self._waiting.get(timeout=wait_s) if wait_s else self._waiting.get_nowait()
            except Empty:
                return None
            if not asked.dropped:
                return asked

    def _answer_request(self, asked: SideRequest, now: RequestConditions) -> Lines | BaseException:
        try:
            self._refuse(asked, now)
            timeout_s = asked.timeout_s if now.at_rest else min(asked.timeout_s, ANSWER_S)
            return self._client.request(asked.line, timeout_s, lines=asked.lines)
        except ProblemError as error:
            return error if isinstance(error, DriverError) else DriverError(*error.problems)
        except Exception as fault:  # a fault here would be taken for one of the machine
            value = f"{type(fault).__name__}: {fault}"
            return DriverError(Problem(code="session.fault", value=value[:100]))

    def _refuse(self, asked: SideRequest, now: RequestConditions) -> None:
        where = self.link.address
        if now.lost:
            raise LinkError(Problem(code="beside.silent", where=where))
        if not (asked.line.isascii() and asked.line.isprintable()):  # a control character acts by itself
            raise RefusedError(Problem(code="terminal.writes", value=asked.line[:40]))
        if asked.kind is RequestKind.QUERY:
            permission(asked.line, self.dialect)
        elif not (asked.kind is RequestKind.GATHER and gathers(asked.line, self.dialect)):
            if not expected_replies(asked.line).reads_only:
                raise RefusedError(Problem(code="terminal.writes", value=asked.line[:40]))
        if asked.kind is not RequestKind.QUERY and not now.controls:
            raise RefusedError(Problem(code="beside.observer", where=where))
        if asked.kind is RequestKind.LISTING and not now.at_rest:
            raise RefusedError(Problem(code="beside.moves", where=where))
