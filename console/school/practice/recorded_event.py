"""The event for which a recording was frozen, and the fault of the simulated lathe that is like it. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from console.flight.recording import Recording
from console.session.station.alarms import FAULT
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem

SILENT = ("link.silent", "link.out_of_step", "link.not_in_step")
LOST, TIMEOUT, LAPSED = "link.lost", "machine.timeout", "heartbeat.lapsed"
OUT_OF_PHASE = ("cut.out_of_phase", "cut.tool_leads")

OVER_S = 20
"""How long a fault lasts that ends by itself: a trainee has no other way to mend the lathe."""

_AXIS_FAULTS = {
    "fatal_following_error": "following-error-trip motor={axis}",
    "amplifier_fault": f"amplifier-fault motor={{axis}} for={OVER_S}",
    "positive_limit": f"limit motor={{axis}} direction=positive for={OVER_S}",
    "negative_limit": f"limit motor={{axis}} direction=negative for={OVER_S}",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """A fault as `console fault` takes it; `doubt` names why the cause may have been another, else ""."""

    fault: str
    doubt: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedEvent:
    """One event at machine time: its reason, the problem of its alarm, and the fault that is like it."""

    at_s: float
    reason: str
    problem: Problem | None = None
    like: Likeness | None = None

    @property
    def fault(self) -> str:
        """The name of the fault, "" without one."""
        return "" if self.like is None else self.like.fault.split()[0]


def event_of(recording: Recording) -> RecordedEvent:
    """Return the event to practise: the first that a fault is surely like, else may be like, else the first."""
    found = list(_events(recording))
    sure = [each for each in found if each.like is not None and not each.like.doubt]
    alike = [each for each in found if each.like is not None]
    return (sure or alike or found)[0]


def _events(recording: Recording) -> Iterator[RecordedEvent]:
    header = recording.header
    if not header.causes:
        yield RecordedEvent(at_s=header.ended_s, reason="")
    for cause in header.causes:
        alarms = recording.moments[recording.place_at(cause.at_s)].state.alarms
        problem = next((each.problem for each in alarms if each.problem.code == cause.reason), None)
        like = None if problem is None else likeness(problem)
        yield RecordedEvent(at_s=cause.at_s, reason=cause.reason, problem=problem, like=like)


def likeness(problem: Problem) -> Likeness | None:
    """Return the fault that raises an alarm like this one, None where the catalogue has none."""
    if problem.code == FAULT:
        return _of_axis(problem.value)
    if problem.code == LOST:
        return Likeness(fault=f"cut-cable for={OVER_S}")
    if problem.code in SILENT:
        return Likeness(fault="hang for=3", doubt="practice.doubt_silent")
    if problem.code == LAPSED:
        return Likeness(fault="hang for=0.5", doubt="practice.doubt_silent")
    if problem.code in OUT_OF_PHASE:
        return Likeness(fault="following-error-trip motor=tool", doubt="practice.doubt_phase")
    what, _, axis = problem.key.partition(" ")
    if problem.code == TIMEOUT and what == "home" and axis in tuple(AxisName):
        return Likeness(fault=f"index-lost motor={axis} for=75", doubt="practice.doubt_index")
    return None


def _of_axis(faults: str) -> Likeness | None:
    """Return what is like the first of some faults of axes (`tool: amplifier_fault, ...`)."""
    for each in faults.split(", "):
        axis, _, flag = each.partition(": ")
        if flag in _AXIS_FAULTS and axis in tuple(AxisName):
            return Likeness(fault=_AXIS_FAULTS[flag].format(axis=axis))
    return None
