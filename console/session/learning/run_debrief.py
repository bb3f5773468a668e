"""The debrief of a recorded run: its course, the cost on the part with the causes, the gaps of the record.

From recorded facts alone. Why a part is not round is found as on the page Inspect: by its trace, its job, its
machine and how it was cut, as they were recorded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from console.session.data.measured_part import RecordedPart
from console.session.data.run_rows import FAILED_HOW, RunOutcome
from console.session.data.run_story import COMMAND, RunEvent, RunStory
from console.session.learning.row_faults import NO_FAULTS, PLAIN, ends_of, find_faults
from console.session.stages import Stage
from console.session.stop_keys import is_by_key
from profiles.compensations.hypotheses import FaultDiagnosis
from profiles.metrology.conformity import ToleranceKind
from profiles.metrology.length_causes import LengthCause, causes_of_failure
from profiles.problem import Problem

SEEN_WITHIN_S = 60.0

SHOWN = frozenset(
    {"started", "feed_hold", "resumed", "adjusted", "stopped", "collision", "fault", "link_back"}
    | {"cut", "held", "ended_early", "measured", "part", "result", "ended"}
)
"""Kinds of events that a debrief shows."""

COMMANDS = frozenset({"EndCut", "HoldFeed", "ResumeFeed", "Adjust", "Retract", "Recover"})
"""Commands that it shows: what was done about a cut."""


class Advice(StrEnum):
    """Advice for the next run, besides that of the causes."""

    CAUSES = "causes"
    PLAIN = "plain"
    ENDED = "ended"
    STOPPED = "stopped"
    DIAMETER = "diameter"
    STOPS = "stops"
    ALARMS = "alarms"
    MEASURE = "measure"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Incident:
    """An incident, `at_s` s (machine time) after the start: an event, an alarm `raised` or `seen`."""

    at_s: float
    event: RunEvent | None = None
    raised: Problem | None = None
    seen: Problem | None = None
    unseen_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RunDebrief:
    """The debrief of a run.

    `diagnosis` compares what may be wrong by the parts so far; None where the record does not tell. `worse` is
    why compensation is advised against. `along` is why the sections of a part that fails differ, `off_um` the
    deviation of its diameter, None if within its tolerance or not judged; `unknown` are the gaps of the record.
    """

    happened: tuple[Incident, ...]
    part: RecordedPart | None
    fails_round: bool
    off_um: float | None
    diagnosis: FaultDiagnosis | None
    worse: tuple[Problem, ...]
    along: tuple[LengthCause, ...]
    unknown: tuple[Problem, ...]
    advice: tuple[Advice, ...]


def run_debrief(story: RunStory, data: Path, *, explains: bool = True) -> RunDebrief:
    """Return the debrief of a run; learned versions are those of the data folder. It raises nothing.

    Unless it `explains`, the diagnosis is left for later: it takes a second of numerics.
    """
    part = story.product
    judged = part is not None and part.passed is not None and part.tolerance_um is not None
    fails_round = judged and part is not None and part.is_round is False
    faults = find_faults(story, data) if explains and part is not None else NO_FAULTS
    unknown = list(_unknown(story, part))
    if fails_round:
        unknown += faults.unknown if explains else (Problem(code="debrief.later"),)
    happened = tuple(_list_events(story))
    size = None if part is None else part.figure(ToleranceKind.DIAMETER)
    off_um = size.value_um if size is not None and size.passes is False else None
    found = RunDebrief(
        happened=happened,
        part=part,
        fails_round=fails_round,
        off_um=off_um,
        diagnosis=faults.diagnosis,
        worse=faults.worse,
        along=causes_of_failure(part.length_causes, part.judged)
        if part is not None and part.passed is False
        else (),
        unknown=tuple(unknown),
        advice=(),
    )
    stopped = story.row.ended.how in FAILED_HOW - {RunOutcome.HELD}
    none = Advice.STOPPED if stopped else Advice.NONE
    return replace(found, advice=tuple(_advice(story, found)) or (() if found.worse else (none,)))


def _unknown(story: RunStory, part: RecordedPart | None) -> Iterator[Problem]:
    if story.damaged:
        yield Problem(code="debrief.damaged", value=", ".join(story.damaged))
    if story.row.ended.how is RunOutcome.OPEN:
        yield Problem(code="debrief.no_end")
    if story.complete is False:
        yield Problem(code="debrief.incomplete")
    if part is None:
        yield Problem(code="debrief.not_measured")
        return
    if part.passed is None:
        partial, code = story.row.stage == Stage.PARTIAL, "debrief.not_judged"
        code = "debrief.no_length" if part.is_good is None else code
        code = "debrief.no_sections" if part.ront_um is None else code
        yield Problem(code="debrief.partial" if partial else code)
    if part.trace is None:
        yield Problem(code="debrief.no_trace")
    if story.job_text is None or story.machine_text is None:
        yield Problem(code="debrief.no_texts")
    if not any("tool_lobe_um" in event.data for event in ends_of(story)):
        yield Problem(code="debrief.no_tool_error")
    if part.diameter_mm is None:
        yield Problem(code="debrief.no_diameter")


def _list_events(story: RunStory) -> Iterator[Incident]:
    began_s = next((event.at_s for event in story.events if event.kind == "started"), 0.0)
    found = [Incident(at_s=event.at_s - began_s, event=event) for event in story.events if _is_shown(event)]
    for alarm in story.alarms:
        found.append(Incident(at_s=alarm.raised_s - began_s, raised=alarm.problem))
        if alarm.acknowledged_s is not None:
            unseen_s = alarm.acknowledged_s - alarm.raised_s
            found.append(Incident(at_s=alarm.acknowledged_s - began_s, seen=alarm.problem, unseen_s=unseen_s))
    yield from sorted(found, key=lambda each: each.at_s)


def _is_shown(event: RunEvent) -> bool:
    if event.kind == "step":
        return event.data.get("step") == "cut"
    return event.kind in SHOWN or (event.kind == COMMAND and event.data.get("command") in COMMANDS)


def _advice(story: RunStory, found: RunDebrief) -> Iterator[Advice]:
    if (found.fails_round and found.diagnosis is not None) or found.along:
        yield Advice.CAUSES
    elif found.fails_round and story.row.strategy in PLAIN:
        yield Advice.PLAIN
    if story.row.ended.how in FAILED_HOW and any(told.raised is not None for told in found.happened):
        yield Advice.ENDED
    if found.off_um is not None:
        yield Advice.DIAMETER
    stops = [event for event in story.events if event.kind == "stopped" and event.data.get("turn") is not None]
    if any(is_by_key(str(event.data.get("reason", ""))) for event in stops):
        yield Advice.STOPS
    if any(told.unseen_s > SEEN_WITHIN_S for told in found.happened):
        yield Advice.ALARMS
    if found.part is None and story.row.ended.how is RunOutcome.DONE and story.row.stage != Stage.AIR:
        yield Advice.MEASURE
