"""An event of a lesson: what comes unasked some time after a step.

It is a fault that the simulated lathe gets, or another console that takes control of it, once it is at rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from drivers.errors import RefusedError
from drivers.simulator.faults.board import check_line
from profiles.fields import Field, FieldType, read_fields
from profiles.problem import Problem

LINE_CAP = 200
CONSOLE = "another-console"
"""The word of a console that takes control, where faults have their names."""

_FIELDS = (
    Field(key="after", kind=FieldType.TEXT, default=""),
    Field(key="wait_s", unit="s", default=0.0, at_least=0.0, at_most=3600.0),
    Field(key="fault", kind=FieldType.TEXT, longest=LINE_CAP, default=""),
    Field(key="console", kind=FieldType.TEXT, default=""),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LessonEvent:
    """A fault (`NAME [KEY=VALUE ...]`) that comes `wait_s` after a step was made, or after the begin ("").

    Or else a `console` takes control: the name of its operator, and after an @ that of the computer.
    """

    after: str
    wait_s: float
    fault: str = ""
    console: str = ""

    @property
    def word(self) -> str:
        """What comes, as one line that begins with its name."""
        return self.fault or f"{CONSOLE} {self.console}"


def read_events(given: object, steps: Sequence[str], where: str) -> tuple[tuple[LessonEvent, ...], list[Problem]]:
    """Return the events of a lesson with these steps, and everything that is wrong with them."""
    tables = given if isinstance(given, list) else [given]
    events: list[LessonEvent] = []
    problems: list[Problem] = []
    for number, table in enumerate(tables, start=1):
        prefix = f"event {number}: "
        content: Mapping[str, Any] = table if isinstance(table, dict) else {"fault": table}
        values, found = read_fields(_FIELDS, content, where=where, prefix=prefix)
        if not found:
            event = LessonEvent(**values)
            found = _problems(event, steps, where, prefix)
            events.append(event)
        problems += found
    return tuple(events), problems


def _problems(event: LessonEvent, steps: Sequence[str], where: str, prefix: str) -> list[Problem]:
    problems: list[Problem] = []
    if event.after and event.after not in steps:
        key, limit = f"{prefix}after", " | ".join(steps)
        problems.append(Problem(code="value.not_choice", where=where, key=key, value=event.after, limit=limit))
    if not event.fault or event.console:
        if event.fault or not event.console:
            problems.append(
                Problem(code="lesson.event", where=where, key=f"{prefix}fault", limit="fault | console")
            )
        return problems
    try:
        check_line(event.fault)
    except RefusedError as refused:
        problem = refused.problems[0]
        key = f"{prefix}fault {problem.key}"
        value, limit = problem.value, problem.limit
        problems.append(Problem(code="lesson.fault", where=where, key=key, value=value, limit=limit))
    return problems
