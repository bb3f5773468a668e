"""Another part of the same job, from the run record: which there are, and the trace of one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.run_reader import RecordedPart, measured_parts, story
from console.session.learning.evaluated_part import EvaluatedPart, evaluated_part
from console.session.station.state import MeasuredPart
from console.tui.records.background_reader import BackgroundReader, Problems
from profiles.files import printable
from profiles.problem import Problem, ProfileError

MOST_PARTS = 200
"""The newest parts that are offered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartQuery:
    """Of which job and machine the parts are; `but` is the run of the part that they are compared with."""

    job: str
    machine: str
    simulated: bool
    but: str | None


def query_of(part: MeasuredPart, machine: str, *, simulated: bool) -> PartQuery:
    """Return which parts may lie beside a measured one."""
    return PartQuery(job=part.job.name, machine=machine, simulated=simulated, but=part.run_id)


class PartReader:
    """Read parts beside the screen; None is returned meanwhile, problems where they cannot be read."""

    def __init__(self, data: Path) -> None:
        self._data = data
        self._listing: BackgroundReader[list[RecordedPart]] = BackgroundReader()
        self._part: BackgroundReader[EvaluatedPart] = BackgroundReader()

    def listed(self, which: PartQuery, version: int) -> list[RecordedPart] | Problems | None:
        """Return the parts, newest first; another `version` reads them again."""

        def read() -> list[RecordedPart]:
            found = measured_parts(self._data, which.job, which.machine, which.simulated, MOST_PARTS)
            return [point for point in reversed(found) if point.run_id != which.but]

        return self._listing.answer((which, version), read)

    def part(self, point: RecordedPart) -> EvaluatedPart | Problems | None:
        """Return one of them with its trace."""
        return self._part.answer((point.run_id, point.part), lambda: other_part(self._data, point))


def other_part(data: Path, point: RecordedPart) -> EvaluatedPart:
    """Read a part, judged at spindle angles.

    Raises SessionError: as `story`, and `inspect.no_trace`; ProfileError: its trace cannot be read.
    """
    run = story(data, point.run_id)
    products = [each for each in run.parts if each.product and each.part == point.part]
    found = None
    if products:
        part = replace(point, trace=products[-1].trace, trace_name=products[-1].trace_name, data=products[-1].data)
        found = evaluated_part(part, run.setup, "result", on_spindle=True)
    if found is None:
        raise ProfileError(Problem(code="inspect.no_trace", key=printable(point.run_id, 8)))
    return found
