"""A controller as a worker thread sees it: each line goes through the link's thread, between two polls."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from drivers.controller import REPLY_TIMEOUT_S, Controller
from drivers.errors import LinkError, RefusedError
from drivers.link.base import Link, is_gone
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import expected_replies, replied_number
from drivers.requests.permitted_lines import RequestKind
from drivers.requests.side_line import REST_TIMEOUT_S, CancelledError, SideLine, SideRequest
from profiles.problem import Problem

TRIES = 3  # of a line that only reads


class SideController(Controller):
    """Asks for one piece of work, all of one kind.

    `requests_sent` counts its requests, `reply_lines` the lines of data in their replies.
    Nothing here can move anything: the link's thread sends only what `permitted` allows.
    """

    def __init__(self, side: SideLine, kind: RequestKind) -> None:
        self.requests_sent = self.reply_lines = 0
        self._side, self._kind = side, kind
        self._cancelled, self._last = False, ""

    @property
    def link(self) -> Link:
        """The link; it is not used directly."""
        return self._side.link

    @property
    def dialect(self) -> Dialect:
        """The family of the controller."""
        return self._side.dialect

    @property
    def cancelled(self) -> bool:
        """Whether the work is to end."""
        return self._cancelled

    def cancel(self) -> None:
        """End the work at its next request."""
        self._cancelled = True

    def end_if_cancelled(self) -> None:
        """Raise CancelledError once the work is to end."""
        if self._cancelled:
            raise CancelledError

    def connect(self) -> tuple[str, str]:
        """Return version and type; the link is connected already."""
        version, kind = (text.strip() for text in self.query("VERSION", "TYPE", again=True))
        return version, kind

    def request(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Ask one line; errors as `SideLine.ask`."""
        self._last = line
        lines = expected_replies(line).lines if lines is None else lines
        asked = SideRequest(line=line, kind=self._kind, lines=lines, timeout_s=timeout_s)
        self.requests_sent += 1
        answer = self._side.ask(asked, lambda: self._cancelled)
        self.reply_lines += len(answer)
        return answer

    def send(
        self,
        line: str,
        timeout_s: float = REPLY_TIMEOUT_S,
        check: Callable[[], None] = lambda: None,
        *,
        moves: bool = False,
    ) -> None:
        """Refuse: nothing is sent without its reply from here."""
        raise RefusedError(Problem(code="terminal.writes", value=line[:40]))

    def reply(self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None) -> tuple[str, ...]:
        """Refuse, as `send`."""
        raise RefusedError(Problem(code="terminal.writes", value=line[:40]))

    def query(self, *items: str, timeout_s: float = REST_TIMEOUT_S, again: bool = False) -> tuple[str, ...]:
        """Ask several values; with `again` once more after a fault of the link."""
        line = " ".join(items)
        return self.question(line, timeout_s, lines=len(items)) if again else self.request(line, lines=len(items))

    def question(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Ask a line that changes nothing, again after a fault of the link that is not its end."""
        for tried in range(1, TRIES + 1):
            try:
                return self.request(line, timeout_s, lines=lines)
            except LinkError as error:
                if tried == TRIES or is_gone(error) or error.problems[0].code == "beside.silent":
                    raise
        raise AssertionError  # the last try returns or raises

    def numbers(self, *items: str, timeout_s: float = REST_TIMEOUT_S, again: bool = False) -> tuple[float, ...]:
        """Ask several numbers."""
        return tuple(map(self.number, self.query(*items, timeout_s=timeout_s, again=again)))

    def number(self, answer: str) -> float:
        """Parse an answer as a number. Raises LinkError: `link.out_of_step`."""
        return replied_number(answer, self.link.address, self._last)

    def download(self, lines: Iterable[str]) -> None:
        """Refuse, as `send`."""
        raise RefusedError(Problem(code="terminal.writes", value=" ".join(lines)[:40]))
