"""Reading in a thread: a slow disk delays the display, never a key or the next tick."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from console.session.errors import fault_problem
from profiles.problem import Problem, ProblemError

Found = TypeVar("Found")
Problems = tuple[Problem, ...]

SHORT_S = 0.03
"""How long a new question is waited for: a healthy disk answers in this time, and nothing flickers."""


class BackgroundReader(Generic[Found]):
    """Answers one query after the other in a thread; outdated queries are dropped.

    Unless it `waits`, the answer comes at a later tick: for many queries in a row.
    """

    def __init__(self, *, waits: bool = True) -> None:
        self._waits = waits
        self._found: tuple[Hashable, Found | Problems] | None = None
        self._thread: threading.Thread | None = None

    def answer(self, question: Hashable, read: Callable[[], Found]) -> Found | Problems | None:
        """Return the answer, or the problems of a refusal; None while it is read. Called at each tick."""
        if self._thread is None or not self._thread.is_alive():
            if self._found is None or self._found[0] != question:
                work = (question, read)
                self._thread = threading.Thread(target=self._read, args=work, name="records", daemon=True)
                self._thread.start()
                if self._waits:
                    self._thread.join(SHORT_S)
        found = self._found
        return found[1] if found is not None and found[0] == question else None

    def _read(self, question: Hashable, read: Callable[[], Found]) -> None:
        found: Found | Problems
        try:
            found = read()
        except ProblemError as error:
            found = tuple(error.problems)
        except Exception as fault:  # in a thread of its own: nobody else would hear of it
            found = (fault_problem(fault),)
        self._found = question, found
