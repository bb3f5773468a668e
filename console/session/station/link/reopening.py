"""Open a lost link again: one attempt after the other, each in a thread that nobody waits for.

Connecting may take seconds (a name server, a computer that does not answer), in which the link thread must still
take a stop and end when it is asked to.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from console.session.errors import fault_problem
from drivers.errors import LinkError
from drivers.link.base import Link
from drivers.link.passing import RenewableLink
from profiles.problem import Problem

RETRY_S = 1.0  # time between two attempts


class ConnectionReopener:
    """Attempts to open the connection beneath `link`; nothing is sent on it. Used from one thread.

    `attempts` counts them since `begin`, `problem` is why the last one failed.
    """

    def __init__(
        self, link: RenewableLink, connect: Callable[[], Link], over: Callable[[], bool] = lambda: False
    ) -> None:
        """Take `connect`, which opens it or raises LinkError, and `over`: there is nothing left to connect to."""
        self._link, self._connect, self._over = link, connect, over
        self.attempts = 0
        self.problem: Problem | None = None
        self._attempt: _Attempt | None = None
        self._next_s = float("-inf")

    def begin(self, now_s: float) -> None:
        """Give the lost connection up."""
        self._link.drop()
        self.attempts, self.problem, self._next_s = 0, None, now_s

    def lose(self, problem: Problem) -> None:
        """Give up a good connection for this reason: everything sent from now on fails with it."""
        self._link.drop(problem)
        if self._attempt is not None:
            self._attempt.abandon()
            self._attempt = None

    @property
    def for_ever(self) -> bool:
        """Whether there is nothing left to connect to."""
        return self._over()

    def poll(self, now_s: float) -> bool:
        """Begin an attempt where one is due; return True once the link has a new connection."""
        attempt = self._attempt
        if attempt is None:
            if now_s < self._next_s or self.for_ever:
                return False
            self.attempts += 1
            self._attempt = attempt = _Attempt(self._connect)
        if not attempt.over:
            return False
        self._attempt, self.problem, self._next_s = None, attempt.problem, now_s + RETRY_S
        if attempt.link is None:
            return False
        self._link.renew(attempt.link)
        return True

    def give_up(self, now_s: float, problem: Problem) -> None:
        """Give up a connection on which nothing answers; the next attempt comes after the usual time."""
        self._link.drop()
        self.problem, self._next_s = problem, now_s + RETRY_S

    def close(self) -> None:
        """Give up an attempt that is under way."""
        if self._attempt is not None:
            self._attempt.abandon()


class _Attempt:
    """One attempt, in a thread of its own; `link` or `problem` is there once it is `over`."""

    def __init__(self, connect: Callable[[], Link]) -> None:
        self.link: Link | None = None
        self.problem: Problem | None = None
        self.over = False
        self._connect, self._abandoned, self._lock = connect, False, threading.Lock()
        threading.Thread(target=self._run, name="reopen", daemon=True).start()

    def _run(self) -> None:
        link, problem = None, None
        try:
            link = self._connect()
        except LinkError as error:
            problem = error.problems[0]
        except Exception as fault:
            problem = fault_problem(fault)
        with self._lock:
            if self._abandoned and link is not None:
                link.close()
            self.link, self.problem, self.over = link, problem, True

    def abandon(self) -> None:
        """Close what it has opened, or may still open."""
        with self._lock:
            self._abandoned = True
            if self.over and self.link is not None:
                self.link.close()
