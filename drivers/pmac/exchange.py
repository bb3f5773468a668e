"""One request in flight on a link, and resynchronisation after an unexpected reply.

The proof of being in step is a marker: a fresh number is written to a variable of the controller and read back in
the same line. Lines are answered in order, so every earlier reply is complete by then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress

from drivers.clock import Clock
from drivers.controller import REPLY_TIMEOUT_S
from drivers.errors import LinkError, LinkTimeoutError, RefusedError
from drivers.link.base import Link
from drivers.pmac.expected_replies import expected_replies, opens_buffer
from drivers.pmac.framing import (
    ASK,
    PROBE,
    QUIET_S,
    SILENCE_S,
    ChecksumForm,
    FaultError,
    FaultKind,
    FramingError,
    LinkFaults,
    Reply,
    ReplyReader,
    await_reply,
    form_of,
    format_reply,
    like_an_answer,
    unmistakable,
)
from drivers.pmac.reserved import MARKER
from drivers.pmac.saving import SAVE_TIMEOUT_S, saves
from profiles.problem import Problem

CR, FLUSH = b"\r", b"\x18"
CHECKSUM_TIMEOUT_S = 0.3
"""How long the controller may take to report the checksum of a line; nothing is executed yet."""

CHECKSUM_TRIES = 2  # Attempts to get a checksum from a controller before it counts as unable to report one
DRAIN_LIMIT_S = 2.0  # A source that still sends after this time is not a controller
MESSAGES_KEPT = 100  # Maximum number of unread program messages; the oldest are dropped first
_MARKERS = 8_000_000  # Markers are integers below 2^23, so that every variable holds them exactly


class Exchange:
    """Sends lines and receives their replies; any fault is counted, and the next line resynchronises first.

    `faults` is replaced by reference, and may be read from any thread. `checksums` is the form of the controller's
    line checksum, None until one has been seen. `last` is the last line that was sent for somebody.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.link = link
        self.faults = LinkFaults()
        self.in_step = True
        self.messages: deque[str] = deque(maxlen=MESSAGES_KEPT)
        self.buffer_open = False
        self.last = ""
        self.checksums: ChecksumForm | None = None
        self._clock = clock
        self._reader = ReplyReader()
        self._in_flight: str | None = None
        self._was_open = False
        self._settings = ""
        self._marker = 0
        # Whether a line that moves may be at the controller without its end: the next bytes sent would end it.
        self._begun = False

    def forget(self) -> None:
        """Drain the line; from now on nothing about the controller is known or proven, until `prove`.

        Raises LinkError: `link.not_in_step`, a partial line cannot be proven to be erased; or the link broke.
        """
        self._erase(self._clock.now_s() + REPLY_TIMEOUT_S)
        self._settings, self.checksums = "", None
        self._flush()
        self.in_step = True

    def prove(self, settings: str) -> None:
        """Get in step with these settings; every resynchronisation restores them.

        Raises LinkError: `link.not_in_step`, or `controller.buffer_open`.
        """
        self._settings = settings
        self.in_step = False
        self.resynchronise()

    def learn_checksums(self) -> None:
        """Find out whether and how the controller reports the checksum of a line; nothing is executed.

        Raises LinkError: as for `resynchronise`.
        """
        for _ in range(CHECKSUM_TRIES):
            self.link.send(PROBE + ASK)
            reported, deadline = b"", self._clock.now_s() + CHECKSUM_TIMEOUT_S
            while came := self.link.receive(QUIET_S if reported else CHECKSUM_TIMEOUT_S):
                reported += came
                if self._time_left_s(deadline) <= 0.0:
                    break
            self.checksums = form_of(reported, PROBE)
            self._flush()
            if self.checksums is not None:
                break
        self.in_step = False
        self.resynchronise()

    def drain(self, limit_s: float = DRAIN_LIMIT_S, quiet_s: float = QUIET_S) -> int:
        """Read until the line was quiet for `quiet_s`, and discard the input; no longer than the caller can wait.

        Return how many bytes came from a source that still sends then; 0 where the line has become quiet.
        """
        deadline, count = self._clock.now_s() + min(limit_s, DRAIN_LIMIT_S), 0
        while came := self.link.receive(quiet_s):
            count += len(came)
            if self._clock.now_s() >= deadline:
                break
        self._reader.clear()
        return count if came else 0

    def send(
        self,
        line: str,
        data: bytes,
        timeout_s: float,
        check: Callable[[], None] = lambda: None,
        *,
        summed: bool = False,
    ) -> None:
        """Send a line, in step; unsolicited input is handled first. See `PmacClient.send`.

        A line that is `summed` is ended only when the controller has reported the right checksum for it.
        """
        if self._in_flight is not None:
            self._lose_step(FaultKind.ABANDONED, self._in_flight, timeout_s)
        elif self._has_unsolicited_input():
            self._lose_step(FaultKind.UNASKED, "", timeout_s)
        if not self.in_step:
            self.resynchronise(timeout_s)
        check()
        if summed and self.checksums is not None:
            self._bring(line, unmistakable(data), self.checksums, check)
            data = b""
        self._was_open = self.buffer_open
        self.buffer_open = self.buffer_open or opens_buffer(line) is True
        self._in_flight = self.last = line
        try:
            self.link.send(data + CR)
        except LinkError as error:
            raise self._lost_error(line, error) from error

    def reply(self, line: str, timeout_s: float, lines: int | None) -> Reply:
        """Return the reply to the line that was sent, with `lines` lines of data where that is not None.

        A SAVE has its seconds, and the NUL of a board that gives up over it is no failure, see `_await_save`.

        Raises:
            LinkTimeoutError: `link.silent`, no complete reply in time.
            LinkError: the link broke, or `link.out_of_step`; and `link.outcome_unknown` if it may have had effect.
        """
        try:
            reply = self._await_save(line, timeout_s) if saves(line) else self._await(timeout_s)
            accepted = reply.error_number is None
            # A refusal may follow the replies of earlier commands in the line, which may be anything.
            if accepted and lines is not None and len(reply.lines) != lines:
                raise FaultError(FaultKind.LINE_COUNT, f"{len(reply.lines)} CR", f"≠ {lines} CR")
            self._in_flight, self._begun = None, False
            if not accepted:
                self._prove_refusal(timeout_s)
        except FaultError as fault:
            raise self._fault(fault, line, timeout_s) from None
        except LinkError as error:
            raise self._lost_error(line, error) from error
        opens = opens_buffer(line)
        if opens and not accepted:
            self.buffer_open = self._was_open
        elif accepted and opens is False:
            self.buffer_open = False
        return reply

    def resynchronise(self, timeout_s: float = REPLY_TIMEOUT_S) -> None:
        """Prove that link and controller are in step again, restore the settings, and close what may be open.

        It takes at most `REPLY_TIMEOUT_S`, whatever a listing may take.

        Raises:
            LinkTimeoutError: `link.not_in_step`.
            LinkError: the link broke; or `controller.buffer_open`, opened by another client.
        """
        timeout_s = min(timeout_s, REPLY_TIMEOUT_S)
        if self.in_step:
            self._flush(timeout_s)
        self.in_step = False
        deadline, refusals = self._clock.now_s() + timeout_s, 0
        self._erase(deadline)
        while True:
            closed = self._closes_buffer(deadline)
            # Before the first settings there is nothing to restore, and nothing to recognise another's marker by.
            reply = self._exchange_marker(self._settings, self._time_left_s(deadline)) if self._settings else None
            if self._is_marked(reply) or (closed and not self._settings):
                self.in_step, self.buffer_open = True, False
                return
            refusals += reply is not None and reply.error_number is not None
            self._flush(self._time_left_s(deadline))
            if refusals > 1:  # one may have been the error of a controller program
                raise LinkError(Problem(code="controller.buffer_open", where=self.link.address))
            if self._time_left_s(deadline) <= 0.0:
                value = f"{timeout_s:g} s"
                raise LinkTimeoutError(Problem(code="link.not_in_step", where=self.link.address, value=value))

    def _bring(self, line: str, data: bytes, form: ChecksumForm, check: Callable[[], None]) -> None:
        """Send a line except its end; erase it at the controller if it must not be ended."""
        expected, reported = form.answer(data), b""
        self._begun = True
        try:
            reported = self._checksum_of(data, expected)
            if reported == expected:
                check()
                return
        except LinkError as error:
            raise self._lost_error(line, error) from error
        except BaseException:
            self._leave()  # a stop that comes now finds no line that could still be ended
            raise
        raise self._not_brought(line, reported, expected)

    def _checksum_of(self, data: bytes, expected: bytes) -> bytes:
        """Send characters of a line, and return the controller's output for them. Messages are kept."""
        self.link.send(data + ASK)
        deadline = self._clock.now_s() + CHECKSUM_TIMEOUT_S
        while (left := self._time_left_s(deadline)) > 0.0:
            self._reader.feed(self.link.receive(left))
            try:
                self.messages += self._reader.take_messages()
            except FramingError:
                break
            reported = self._reader.rest
            if (
                reported
                and not self._reader.within_message
                and (reported == expected or not expected.startswith(reported))
            ):
                break
        reported = self._reader.rest
        self._reader.clear()
        return reported

    def _not_brought(self, line: str, reported: bytes, expected: bytes) -> RefusedError | LinkError:
        """Erase a line that did not arrive as it was sent; return the problem to report."""
        where = self.link.address
        problem = Problem(code="link.line_unproven", where=where, key=line, value=f"{CHECKSUM_TIMEOUT_S:g} s")
        if reported:
            value, limit = format_reply(reported), format_reply(expected)
            problem = Problem(code="link.line_differs", where=where, key=line, value=value, limit=limit)
        try:
            # A checksum that looks like a reply is seen again: the line is still there.
            if like_an_answer(reported) and self._checksum_of(b"", reported) != reported:
                self.faults = self.faults.with_another(FaultKind.DIFFERS, line)
                self._leave()  # whatever moves now must be stopped at once
                return LinkError(Problem(code="link.line_in_part", where=where, key=line))
            self._lose_step(FaultKind.DIFFERS if reported else FaultKind.SILENT, line, REPLY_TIMEOUT_S)
            self.resynchronise()
        except LinkError as error:
            self.in_step = False
            return type(error)(problem, *error.problems)
        return RefusedError(problem)

    def _leave(self) -> None:
        """Discard a partial line at the controller now; the proof of that comes before the next line."""
        self.in_step = False
        with suppress(LinkError):
            self.link.send(FLUSH)

    def _erase(self, deadline: float) -> None:
        """Make sure that no line without an end remains at the controller: only our own has been received."""
        form, began_s = self.checksums, self._clock.now_s()
        while self._begun and form is not None:
            self._flush(max(self._time_left_s(deadline), QUIET_S))
            expected = form.answer(PROBE)
            if self._checksum_of(PROBE, expected) == expected:
                self._begun = False
                self._ask("", CHECKSUM_TIMEOUT_S)  # the line's end; its reply does not matter
            elif self._time_left_s(deadline) <= 0.0:
                value = f"{self._clock.now_s() - began_s:.1f} s"
                raise LinkTimeoutError(Problem(code="link.not_in_step", where=self.link.address, value=value))

    def _closes_buffer(self, deadline: float) -> bool:
        """CLOSE what this client may have left open: else all that follows would become program lines.

        The reply proves nothing: a controller with other settings replies in another form, or not at all. A marker
        that is read back does, because an open buffer would have refused it.
        """
        if not self.buffer_open:
            return True
        reply = self._ask("CLOSE", 0.5 * self._time_left_s(deadline))
        if reply is None:
            self.drain()  # no control-X: a controller that reads slowly would discard the CLOSE that waits there
        return reply is not None and not reply.lines and reply.error_number is None

    def _prove_refusal(self, timeout_s: float) -> None:
        """Make sure that a refusal belongs to the line, and is not the error of a program's command.

        Raises FaultError: it does not, or nothing replies any more.
        """
        if not self._settings or self._was_open:
            return  # in an open buffer the marker would become a line of the program
        reply = self._exchange_marker("", min(timeout_s, REPLY_TIMEOUT_S))
        if reply is not None and reply.error_number is not None and not reply.lines:
            self.in_step = False  # a buffer that another client left open refuses the marker, too
        elif not self._is_marked(reply):
            raise FaultError(FaultKind.UNASKED, "BEL ERRnnn")

    def _exchange_marker(self, settings: str, timeout_s: float) -> Reply | None:
        """Write a fresh number and read it back, after some settings; return the reply, None without one."""
        start = self._marker or int(1000.0 * self._clock.now_s())
        self._marker = start % _MARKERS + 1
        return self._ask(f"{settings} P{MARKER}={self._marker} P{MARKER}".strip(), timeout_s)

    def _is_marked(self, reply: Reply | None) -> bool:
        if reply is None or reply.error_number is not None:
            return False
        return [line.strip() for line in reply.lines] == [str(self._marker)]

    def _ask(self, line: str, timeout_s: float) -> Reply | None:
        """Return the next reply to a line of our own, None when no readable one comes."""
        self.link.send(line.encode("ascii") + b"\r")
        try:
            return self._await(max(timeout_s, QUIET_S))
        except FaultError:
            return None

    def _await_save(self, line: str, timeout_s: float) -> Reply:
        """Return the reply to a line with SAVE. Over a NUL it is accepted once the controller is in step again.

        A refusal would have come as one; raises as `resynchronise` does, when the controller stays away.
        """
        deadline = self._clock.now_s() + max(2.0 * timeout_s, SAVE_TIMEOUT_S)
        try:
            return self._await(self._time_left_s(deadline), SAVE_TIMEOUT_S)
        except FaultError as fault:
            if fault.kind is not FaultKind.NUL:
                raise
        self._flush()
        self.in_step = False
        while not self.in_step:
            try:
                self.resynchronise()
            except LinkTimeoutError:
                if self._time_left_s(deadline) <= 0.0:
                    raise
        return Reply(lines=())

    def _await(self, timeout_s: float, silence_s: float = SILENCE_S) -> Reply:
        reply = await_reply(self._reader, self.link, self._clock, timeout_s, silence_s)
        self.messages += reply.messages
        return reply

    def _has_unsolicited_input(self) -> bool:
        """Whether unsolicited input has come. Program messages are kept, and do not count."""
        self._reader.feed(self.link.receive(0.0))
        try:
            self.messages += self._reader.take_messages()
        except FramingError:
            return True
        return not (self._reader.empty or self._reader.within_message)

    def _lose_step(self, kind: FaultKind, line: str, timeout_s: float) -> None:
        self.faults = self.faults.with_another(kind, line)
        self._flush(timeout_s)
        self.in_step = False

    def _flush(self, limit_s: float = DRAIN_LIMIT_S) -> None:
        self._in_flight = None
        self.link.send(FLUSH)
        self.drain(limit_s)

    def _time_left_s(self, deadline: float) -> float:
        return deadline - self._clock.now_s()

    def _lost_error(self, line: str, error: LinkError) -> LinkError:
        """Return the error for a lost link, with its consequence for the line."""
        self._in_flight, self.in_step = None, False
        self.faults = self.faults.with_another(FaultKind.LOST, line)
        return type(error)(*error.problems, *self._outcome(line, FaultKind.LOST))

    def _fault(self, fault: FaultError, line: str, timeout_s: float) -> LinkError:
        try:
            self._lose_step(fault.kind, line, timeout_s)
        except LinkError as error:
            return self._lost_error(line, error)
        where, unknown = self.link.address, self._outcome(line, fault.kind)
        if fault.kind in (FaultKind.SILENT, FaultKind.UNFINISHED):
            silent = Problem(code="link.silent", where=where, key=line, value=fault.actual)
            return LinkTimeoutError(silent, *unknown)
        problem = Problem(code="link.out_of_step", where=where, key=line, value=fault.actual, limit=fault.allowed)
        return LinkError(problem, *unknown)

    def _outcome(self, line: str, kind: FaultKind) -> tuple[Problem, ...]:
        """Return the problem of a line whose reply did not come: none, if it is a query."""
        if expected_replies(line).reads_only:
            return ()
        return (Problem(code="link.outcome_unknown", where=self.link.address, key=line, value=kind),)
