"""One piece of work at the controller, in a thread beside the screen: started, shown while it runs, cancelled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from console.session.errors import fault_problem
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import CancelledError
from profiles.problem import Problem, ProblemError

Found = TypeVar("Found")

SHORT_S = 0.0  # how long a new piece of work is waited for: a tick of the screen waits for nothing


class Errand(Generic[Found]):
    """The last work and its result. `found` stays until the next is done; `problems` are why there is none."""

    def __init__(self) -> None:
        self.found: Found | None = None
        self.problems: tuple[Problem, ...] = ()
        self.cancelled = False
        self.ended = self._told = 0
        self._client: SideController | None = None
        self._thread: threading.Thread | None = None
        self._begun_s = 0.0

    @property
    def running(self) -> bool:
        """Whether it is under way."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def has_news(self) -> bool:
        """Whether work has ended since this was asked last."""
        if self.running or self._told == self.ended:
            return False
        self._told = self.ended
        return True

    @property
    def requests(self) -> int:
        """The requests of the present or last work."""
        return 0 if self._client is None else self._client.requests_sent

    @property
    def answered_lines(self) -> int:
        """The lines of data that were answered to them."""
        return 0 if self._client is None else self._client.reply_lines

    @property
    def elapsed_s(self) -> float:
        """How long the present or last work has been under way."""
        return time.monotonic() - self._begun_s

    def start(
        self, client: SideController | None, work: Callable[[], Found], *, wait_s: float | None = None
    ) -> None:
        """Begin; nothing else may be running."""
        self._client, self.cancelled, self._begun_s = client, False, time.monotonic()
        self._thread = threading.Thread(target=self._run, args=(work,), name="controller", daemon=True)
        self._thread.start()
        self._thread.join(SHORT_S if wait_s is None else wait_s)

    def cancel(self) -> None:
        """End the work at its next request."""
        if self._client is not None and self.running:
            self.cancelled = True
            self._client.cancel()

    def _run(self, work: Callable[[], Found]) -> None:
        problems: tuple[Problem, ...] = ()
        try:
            self.found = work()
        except CancelledError:
            self.cancelled = True
        except ProblemError as error:
            problems = tuple(error.problems)
        except Exception as fault:  # in a thread of its own: nobody else would hear of it
            problems = (fault_problem(fault),)
        self.problems = problems
        self.ended += 1
