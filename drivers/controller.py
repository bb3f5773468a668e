"""The interface of a controller at the end of a link: it takes lines of text and answers them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from drivers.link.base import Link

REPLY_TIMEOUT_S = 2.0
"""Default timeout for the reply to a line."""


class Controller(Protocol):
    """One controller with one line in flight at a time; implemented by `drivers.pmac.client.PmacClient`.

    Commands that move or write are never retried; only queries may be retried (`again`). The text of the lines
    is controller-specific: the modules that write it are listed in the PMAC's import contract.

    Every method raises `LinkError` when the link breaks or is out of step, and `ControllerError` when the
    controller refuses the line.
    """

    @property
    def link(self) -> Link:
        """The link to the controller."""

    def connect(self) -> tuple[str, str]:
        """Flush the line; return the version and type that the controller reports."""

    def request(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Send a line and return the data of its reply: `lines` of them, or as many as the line itself implies."""

    def send(
        self,
        line: str,
        timeout_s: float = REPLY_TIMEOUT_S,
        check: Callable[[], None] = lambda: None,
        *,
        moves: bool = False,
    ) -> None:
        """Send a line without waiting; `reply` must follow. If `check` raises, the line is not sent.

        Where the link can verify it, a line that `moves` is executed only after it has arrived as it was sent.
        """

    def reply(self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None) -> tuple[str, ...]:
        """Return the data of the reply to a line sent before."""

    def query(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S, again: bool = False) -> tuple[str, ...]:
        """Query several values in one line; return exactly one text for each."""

    def question(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Return the data of the reply to a read-only line, retried once after a fault."""

    def numbers(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S, again: bool = False) -> tuple[float, ...]:
        """Query several numbers in one line."""

    def number(self, answer: str) -> float:
        """Parse an answer as a number."""

    def download(self, lines: Iterable[str]) -> None:
        """Send the lines of a program; stop at the first that is rejected and leave no buffer open."""


def query_in_lines(client: Controller, items: Sequence[str], a_line: int) -> list[str]:
    """Query any number of values, `a_line` of them in a line, each line again after a fault; raises as `query`."""
    lines = (items[start : start + a_line] for start in range(0, len(items), a_line))
    return [text for line in lines for text in client.query(*line, again=True)]
