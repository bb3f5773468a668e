"""What happened in a lesson, told from two states of the station in a row. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from console.session.station.alarms import Alarm
from console.session.station.state import MeasuredPart, StationState
from profiles.problem import Problem

RETURNED = "link.returned"  # reason of the stop of a lathe that an instructor has put back: nobody's stop


class HappeningKind(StrEnum):
    """Kinds: a step, a stop, a collision, an alarm raised, one that was seen, a fault, a part, the lesson left.

    `INSTRUCTOR` is what the instructor did that is no fault.
    """

    STEP = "step"
    STOP = "stop"
    MET = "met"
    ALARM = "alarm"
    SEEN = "seen"
    FAULT = "fault"
    PART = "part"
    LEFT = "left"
    INSTRUCTOR = "instructor"


@dataclass(frozen=True, slots=True, kw_only=True)
class Happening:
    """One, `at_s` s since the lesson began.

    `word` is a step, a reason, a kind, a code, a fault, a RONt or an order. An alarm has its `problem`.
    """

    at_s: float
    what: HappeningKind
    word: str = ""
    problem: Problem | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PartFact:
    """A measured part: its RONt with what is allowed, and how far its diameter is off; None if not known.

    `diameter_passes` is None if the job has no tolerance of the diameter. `full` is whether it was cut with all
    of its compensation.
    """

    ront_um: float
    tolerance_um: float | None
    offset_um: float | None
    diameter_passes: bool | None
    full: bool


def happenings(before: StationState, now: StationState, at_s: float) -> tuple[Happening, ...]:
    """Return what happened between two states, at the time of the second."""
    found: list[tuple[HappeningKind, str, Problem | None]] = []
    if now.stop is not None and before.stop is None and now.stop.reason != RETURNED:
        found.append((HappeningKind.STOP, now.stop.reason, None))
    known = before.seen.collisions if before.seen is not None else ()
    met = now.seen.collisions if now.seen is not None else ()
    found += [(HappeningKind.MET, kind, None) for kind in met if kind not in known]
    found += _of_alarms(before, now)
    trace = None if before.measured is None else before.measured.trace
    if now.measured is not None and now.measured.trace is not trace:
        found.append((HappeningKind.PART, f"{now.measured.result.ront_um:.2f}", None))
    return tuple(Happening(at_s=at_s, what=what, word=word, problem=problem) for what, word, problem in found)


def part_fact(part: MeasuredPart) -> PartFact:
    """Return what a debrief needs of a measured part."""
    return PartFact(
        ront_um=part.result.ront_um,
        tolerance_um=part.job.roundness_tolerance_um,
        offset_um=part.tool_offset_um,
        diameter_passes=part.diameter_passes,
        full=not part.is_half,
    )


def _of_alarms(before: StationState, now: StationState) -> list[tuple[HappeningKind, str, Problem | None]]:
    """Return alarms that were raised, and those that somebody has seen: acknowledged, or gone."""
    old, new = _by_code(before), _by_code(now)
    raised = [code for code, alarm in new.items() if code not in old or alarm.count > old[code].count]
    seen = [code for code in old if not old[code].acknowledged and (code not in new or new[code].acknowledged)]
    return [
        *((HappeningKind.ALARM, code, new[code].problem) for code in raised),
        *((HappeningKind.SEEN, code, old[code].problem) for code in seen),
    ]


def _by_code(state: StationState) -> dict[str, Alarm]:
    return {alarm.problem.code: alarm for alarm in state.alarms}
