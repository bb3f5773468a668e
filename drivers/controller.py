"""A controller at the end of a link: it takes lines in a language of its own, and answers them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from drivers.link.base import Link

REPLY_TIMEOUT_S = 2.0
"""How long the reply to a line may take, where nobody says otherwise."""


class Controller(Protocol):
    """One controller, one line in flight at a time. `drivers.pmac.client.PmacClient` is the one there is.

    Nothing that moves or writes is sent twice; only what asks may be asked `again`. What the lines say is the
    language of the controller: whoever words them is listed in the import contract of the PMAC.

    Every method raises `LinkError` when the link breaks or is out of step, and `ControllerError` when the
    controller refuses the line.
    """

    @property
    def link(self) -> Link:
        """What the controller is reached over."""

    def connect(self) -> tuple[str, str]:
        """Empty the line, and return version and kind as the controller states them."""

    def request(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Send a line and return the data of its reply: `lines` of them, or as many as the line itself says."""

    def send(
        self,
        line: str,
        timeout_s: float = REPLY_TIMEOUT_S,
        check: Callable[[], None] = lambda: None,
        *,
        moves: bool = False,
    ) -> None:
        """Send a line without waiting; `reply` must follow. What `check` raises leaves the line unsent.

        Where that can be proven, a line that `moves` is carried out only once it has arrived as it was sent.
        """

    def reply(self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None) -> tuple[str, ...]:
        """Return the data of the reply to a line that was sent before."""

    def query(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S, again: bool = False) -> tuple[str, ...]:
        """Ask for several values in one line; return exactly one text for each."""

    def question(
        self, line: str, timeout_s: float = REPLY_TIMEOUT_S, *, lines: int | None = None
    ) -> tuple[str, ...]:
        """Return the data of the reply to a line that changes nothing, asked a second time after a fault."""

    def numbers(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S, again: bool = False) -> tuple[float, ...]:
        """Ask for several numbers in one line."""

    def number(self, answer: str) -> float:
        """Return what was answered as a number."""

    def download(self, lines: Iterable[str]) -> None:
        """Send the lines of a program; the first that is not accepted ends it, with nothing left open."""
