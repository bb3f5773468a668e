"""What passes between the console of a trainee and the thread that serves the instructor.

Everything is replaced by reference and returns at once, from any thread: nobody waits for the other.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from console.school.instructing.order import InstructorOrder


@dataclass(frozen=True, slots=True, kw_only=True)
class InstructorAct:
    """What the instructor has done, at a local time and at machine time."""

    at: datetime
    at_s: float
    order: InstructorOrder


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """The screen as it was shown at real time `at_s`: rows of characters, for the request of this number."""

    rows: tuple[str, ...]
    number: int
    at_s: float


class Mailbox:
    """`rows` returns the rows of the log of the session, with those of acts that it hides."""

    def __init__(self, rows: Callable[[tuple[InstructorAct, ...]], tuple[str, ...]] = lambda hidden: ()) -> None:
        self._rows = rows
        self.picture: Picture | None = None
        self.hidden: tuple[InstructorAct, ...] = ()
        self._requests = 0
        self._fresh: deque[InstructorAct] = deque()

    def request_picture(self) -> int:
        """Ask for a picture of the screen; return the number of this request."""
        self._requests += 1
        return self._requests

    @property
    def requested_number(self) -> int | None:
        """The number of the newest request, if it has no picture yet."""
        picture = self.picture
        return self._requests if self._requests > (0 if picture is None else picture.number) else None

    def note(self, act: InstructorAct) -> None:
        """Note what was done. Faults are hidden: a trainee has to find them."""
        if act.order.is_fault:
            self.hidden = (*self.hidden, act)
        self._fresh.append(act)

    def fresh(self) -> list[InstructorAct]:
        """Return what was done since this was asked last."""
        return [self._fresh.popleft() for _ in range(len(self._fresh))]

    def log(self) -> tuple[str, ...]:
        """Return the rows of the log of the session with those that it hides, newest last."""
        return self._rows(self.hidden)
