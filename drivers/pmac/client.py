"""The host's side of a PMAC: one request in flight, replies matched by framing and by their number of lines.

Nothing that moves or writes is ever sent twice. When its reply does not come, the error says that its outcome is
unknown, and the caller reads the state of the machine. Only queries may be retried (`again`). After any fault of
the link the next line waits until link and controller are proven to be in step.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from contextlib import suppress

from drivers.clock import Clock
from drivers.controller import REPLY_TIMEOUT_S
from drivers.errors import ControllerError, DriverError, LinkError, LinkTimeoutError, RefusedError
from drivers.link.base import GONE, Link
from drivers.pmac.dialect import DIALECTS, Dialect, dialect_of
from drivers.pmac.exchange import DRAIN_LIMIT_S, Exchange
from drivers.pmac.expected_replies import expected_replies, replied_number
from drivers.pmac.framing import QUIET_S, LineCheck, LinkFaults
from drivers.pmac.language.errors import ErrorCode
from profiles.problem import Problem

__all__ = ["LINE_LIMIT", "REPLY_TIMEOUT_S", "PmacClient"]

LINE_LIMIT = 250  # Maximum length of one command line; the controller's own limit is 255 characters

HANDSHAKE = "I3=2 I6=1"
CHECKSUMS_OFF = "I4=0"
LONGEST_ECHO = 200  # bytes; the answer to a question has some twenty
LATE_S = 1.0  # how late a controller may answer to the first lines
LEAST_LATE_S, LATEST_S = 0.5, 4.0  # within which an answer is reported as late, not as missing
UNCLEAR = ("link.silent", "link.not_a_pmac", "link.not_in_step")  # what an answer that comes late looks like, too
_MARK_MESSAGES = 64
"""The I-variable that marks unsolicited program messages, where the family has it."""

REFUSALS = frozenset((0, *ErrorCode))  # The error numbers that have an explanation

_VERSION = re.compile(r"\d+\.\d+")
_TWICE = re.compile(rb"(\d+\.\d+[^\r]*)\r\n?\1\r")
"""The reply to VERSION VERSION, which is none to any line before."""


class PmacClient:
    """Communicates with one controller over one link."""

    def __init__(self, link: Link, clock: Clock) -> None:
        self.link, self._clock = link, clock
        self._exchange = Exchange(link, clock)
        self._dialect: Dialect | None = None
        self.requests_sent = self.reply_lines = 0  # how far a long reading is

    @property
    def dialect(self) -> Dialect:
        """The family of the controller, from its reply to TYPE.

        Raises RefusedError: `link.not_connected`, it has not been queried yet.
        """
        if self._dialect is None:
            raise RefusedError(Problem(code="link.not_connected", where=self.link.address))
        return self._dialect

    @property
    def faults(self) -> LinkFaults:
        """Link faults so far; may be read from any thread."""
        return self._exchange.faults

    @property
    def in_step(self) -> bool:
        """Whether the next line may be sent as it is; else it waits for `resynchronise`."""
        return self._exchange.in_step

    @property
    def buffer_may_be_open(self) -> bool:
        """Whether this client opened a program buffer that is not yet proven to be closed."""
        return self._exchange.buffer_open

    @property
    def line_check(self) -> LineCheck:
        """What verifies that a line that moves something arrives as it was sent."""
        if self.link.checks_bytes:
            return LineCheck.NETWORK
        return LineCheck.NOBODY if self._exchange.checksums is None else LineCheck.CONTROLLER

    def connect(self) -> tuple[str, str]:
        """Drain the line, set up the handshake, and return version and type as the controller reports them.

        Raises:
            LinkError: `link.silent`, nothing replies; `link.late`, it does, too late; `link.not_a_pmac`, something
                else does; `link.echoes`, `link.line_feeds`, the line changes what is sent; `link.unknown_type`, a
                controller of another family; `link.not_in_step`; `controller.buffer_open`; `link.lost`.
        """
        exchange = self._exchange
        self._dialect = None
        exchange.forget()
        # An earlier client may have left half a line behind: the empty line ends it, and its error is ignored.
        # Checksums may be on (I4), and would follow every reply.
        self.link.send(f"\r{CHECKSUMS_OFF}\r".encode("ascii"))
        if endless := exchange.drain():
            value = f"{endless} bytes in {DRAIN_LIMIT_S:g} s, without a pause"
            raise LinkError(Problem(code="link.not_a_pmac", where=self.link.address, value=value))
        try:
            return self._prove()
        except LinkError as error:
            if error.problems[0].code not in UNCLEAR:
                raise
            raise self._of_the_line(error) from None

    def _prove(self) -> tuple[str, str]:
        """Return version and type of the controller, once it is proven to be in step."""
        version, kind = self._query_identity()
        self._dialect = dialect = dialect_of(kind)
        if dialect is None:
            limit = " | ".join(f"{each.type_prefix}..." for each in DIALECTS.values())
            raise LinkError(
                Problem(code="link.unknown_type", where=self.link.address, value=kind[:40], limit=limit)
            )
        marked = [f"I{_MARK_MESSAGES}=1"] if _MARK_MESSAGES in dialect.ranges else []
        self._exchange.prove(" ".join([HANDSHAKE, CHECKSUMS_OFF, *marked]))
        if not self.link.checks_bytes:
            self._exchange.learn_checksums()
        return version, kind

    def resynchronise(self, timeout_s: float = REPLY_TIMEOUT_S) -> None:
        """Prove with a fresh marker that link and controller are in step; restore I3, I4, I6 and I64.

        A program buffer that this client may have left open is closed. Nothing moves.

        Raises LinkError: `link.not_in_step`, `controller.buffer_open`, or the link is gone.
        """
        self._exchange.resynchronise(timeout_s)

    def take_messages(self) -> tuple[str, ...]:
        """Return and clear the unsolicited messages of controller programs; only the latest are kept."""
        messages = tuple(self._exchange.messages)
        self._exchange.messages.clear()
        return messages

    def request(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Send one line and return the data of its reply: `lines` of them.

        Without `lines` the count follows from the line itself: a command has none. Where it does not (LIST, and
        commands not known here), any number is accepted.

        Raises:
            ControllerError: the controller refused the line.
            LinkTimeoutError: no complete reply in time.
            LinkError: the link broke or is out of step; `link.outcome_unknown` is among its problems if the line
                may have had an effect.
        """
        self.send(line, timeout_s)
        return self.reply(line, timeout_s, lines=lines)

    def send(
        self,
        line: str,
        timeout_s: float = REPLY_TIMEOUT_S,
        check: Callable[[], None] = lambda: None,
        *,
        moves: bool = False,
    ) -> None:
        """Send one line without waiting; `reply` must follow, one line is in flight at a time.

        `timeout_s` limits the resynchronisation where one is due. `check` is called after it, immediately before
        the line is sent: if it raises, the line is not sent. A line that `moves` is executed only after the
        controller has reported its checksum, where the link does not check its bytes and the controller supports
        that; `check` is called again immediately before its end is sent.

        Raises:
            ControllerError: `controller.line_too_long`, nothing was sent.
            RefusedError: `link.line_differs`, `link.line_unproven`: it arrived altered, or that could not be
                checked; it was not executed.
            LinkError: the link broke; `link.line_in_part`; or `link.not_in_step`, `controller.buffer_open`:
                nothing was sent.
        """
        data = line.encode("latin-1")
        if len(data) > LINE_LIMIT or b"\r" in data:
            raise ControllerError(
                Problem(code="controller.line_too_long", where=self.link.address, value=line[:40])
            )
        self.requests_sent += 1
        self._exchange.send(line, data, timeout_s, check, summed=moves)

    def reply(self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None) -> tuple[str, ...]:
        """Return the data of the reply to `line`, which was sent before; raises as `request` does."""
        if lines is None and not self._exchange.buffer_open:
            lines = expected_replies(line).lines
        reply = self._exchange.reply(line, timeout_s, lines)
        self.reply_lines += len(reply.lines)
        if reply.error_number is None:
            return reply.lines
        number = reply.error_number
        where = self.link.address
        problem = Problem(code="controller.err_other", where=where, key=f"ERR{number:03d}", value=line)
        if number in REFUSALS:
            problem = Problem(code=f"controller.err{number:03d}", where=where, value=line)
        raise ControllerError(problem, error_number=number)

    def query(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S, again: bool = False) -> tuple[str, ...]:
        """Query several values in one line; return exactly one text for each; raises as `request` does.

        With `again` the query is retried once, in step, when a fault of the link has spoiled the first reply. A
        line that may change something is then refused, see `question`.
        """
        ask = self.question if again else self.request
        return ask(" ".join(items), timeout_s, lines=len(items))

    def question(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Return the data of the reply to a line that changes nothing; retry once after a fault.

        Raises:
            RefusedError: `controller.not_a_question`, nothing was sent.
            ControllerError: the controller refused it.
            LinkError: the link is lost, or the fault occurred twice.
        """
        if not expected_replies(line).reads_only:
            raise RefusedError(Problem(code="controller.not_a_question", where=self.link.address, value=line[:40]))
        try:
            return self.request(line, timeout_s, lines=lines)
        except LinkError as error:
            if any(problem.code in GONE for problem in error.problems):
                raise
            self._exchange.resynchronise(timeout_s)
        return self.request(line, timeout_s, lines=lines)

    def numbers(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S, again: bool = False) -> tuple[float, ...]:
        """Query numbers; raises as `query` and `number` do."""
        return tuple(map(self.number, self.query(*items, timeout_s=timeout_s, again=again)))

    def number(self, answer: str) -> float:
        """Return the reply to the last line as a number. Raises LinkError: `link.out_of_step`, it is not one."""
        return replied_number(answer, self.link.address, self._exchange.last)

    def download(self, lines: Iterable[str]) -> None:
        """Send program lines one by one; stop at the first that is refused, and close the buffer.

        Raises:
            ControllerError: with the line that was refused.
            LinkError: the link broke or is out of step; with `controller.buffer_may_be_open` if it could not be
                closed.
        """
        try:
            for line in lines:
                # A stored line gets no data in reply, whatever it would reply on-line.
                expected = 0 if self._exchange.buffer_open else expected_replies(line).lines or 0
                self.request(line, lines=expected)
        except DriverError as error:
            self._close_after(error)
            raise
        except BaseException:
            with suppress(LinkError):
                self._close_after(DriverError())
            raise

    def _query_identity(self) -> tuple[str, str]:
        """Ask for version and type; once more where the first answer may be a late one to what was sent before.

        A computer that is busy may let a controller answer later than the line is drained. Nothing of this moves.
        """
        try:
            return self._identify()
        except LinkError as error:
            if error.problems[0].code != "link.not_a_pmac":
                raise
            first = error
        self._exchange.drain(quiet_s=LATE_S)
        self._exchange.forget()
        try:
            return self._identify()
        except LinkTimeoutError:
            raise first from None

    def _of_the_line(self, error: LinkError) -> LinkError:
        """Return what the line does to a question: late, an echo, or line ends of its own; else the same error."""
        self._exchange.drain(quiet_s=LATE_S)
        self._exchange.forget()
        self.link.send(b"VERSION VERSION\r")
        began_s, said, late_s, waits_s = self._clock.now_s(), b"", 0.0, LATEST_S
        while len(said) < LONGEST_ECHO and waits_s > 0.0 and (came := self.link.receive(waits_s)):
            said += came
            passed_s = self._clock.now_s() - began_s
            late_s = late_s or (passed_s if _TWICE.search(said) else 0.0)
            waits_s = QUIET_S if late_s else LATEST_S - passed_s
        code = value = ""
        if said.startswith(b"VERSION"):
            code = "link.echoes"
        elif _VERSION.match(said.split(b"\r")[0].decode("ascii", "replace").strip()) and b"\r\n" in said:
            code = "link.line_feeds"
        elif late_s > LEAST_LATE_S:
            code, value = "link.late", f"{late_s:.1f} s"
        elif said and not late_s and error.problems[0].code == "link.silent":
            code, value = "link.late", f"> {REPLY_TIMEOUT_S:g} s"
        return LinkError(Problem(code=code, where=self.link.address, value=value)) if code else error

    def _identify(self) -> tuple[str, str]:
        try:
            self.request(HANDSHAKE, lines=0)
            version, kind = (reply.strip() for reply in self.query("VERSION", "TYPE"))
        except LinkTimeoutError as error:
            raise LinkTimeoutError(error.problems[0]) from error  # the outcome of the handshake does not matter
        except LinkError as error:
            problem = error.problems[0]
            if problem.code != "link.out_of_step":
                raise
            raise LinkError(
                Problem(code="link.not_a_pmac", where=self.link.address, value=problem.value[:40])
            ) from error
        if not _VERSION.match(version):
            raise LinkError(Problem(code="link.not_a_pmac", where=self.link.address, value=version[:40]))
        return version, kind

    def _close_after(self, error: DriverError) -> None:
        """Close the buffer that a download may have left open.

        Raises LinkError: it cannot be closed, or not proven to be closed.
        """
        if not self._exchange.buffer_open:
            return
        try:
            self._exchange.resynchronise()
        except LinkError as unclosed:
            open_yet = Problem(code="controller.buffer_may_be_open", where=self.link.address)
            raise LinkError(*error.problems, *unclosed.problems, open_yet) from error
