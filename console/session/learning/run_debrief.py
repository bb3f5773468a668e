"""The debrief of a recorded run: its course, the cost on the part with the causes, the gaps of the record.

From recorded facts alone. Why a part is not round is found as on the page Inspect: by its trace, its job, its
machine and how it was cut, as they were recorded.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from console.session.data.measured_part import RecordedPart, made_with, parts_made, tool_lobe_um
from console.session.data.run_reader import RunFilters, runs
from console.session.data.run_reader import story as read_story
from console.session.data.run_rows import FAILED_HOW, RunOutcome
from console.session.data.run_story import COMMAND, RunEvent, RunStory
from console.session.errors import SessionError
from console.session.learning.learning_steps import LearningOutcome, learn_from_part
from console.session.learning.row_result import worse_than_plain
from console.session.stages import Stage
from console.session.stop_keys import is_by_key
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.which_lathe import LATHE, WHICH
from profiles.axis.sampled_loop import loop_of
from profiles.axis.stiffness import compliance_um_per_n
from profiles.compensations.causes import Cause
from profiles.compensations.hypotheses import MULTIPLES, FaultDiagnosis, KnownLathe, PartEvidence, diagnose
from profiles.compensations.path import free_state_lobe
from profiles.files import parse_toml
from profiles.machine import MachineProfile, machine_from_table
from profiles.metrology.conformity import ToleranceKind
from profiles.metrology.length_causes import LengthCause, causes_of_failure
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, LoadedMachine

SEEN_WITHIN_S = 60.0
MOST_EARLIER, LAST_PARTS = 8, 3
HELD_AT = "held_at"

SHOWN = frozenset(
    {"started", "feed_hold", "resumed", "adjusted", "stopped", "collision", "fault", "link_back"}
    | {"cut", "held", "ended_early", "measured", "part", "result", "ended"}
)
"""Kinds of events that a debrief shows."""

COMMANDS = frozenset({"EndCut", "HoldFeed", "ResumeFeed", "Adjust", "Retract", "Recover"})
"""Commands that it shows: what was done about a cut."""


_PLAIN = {each.value for each in Strategy if not each.traits.follows_lobe}


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
    """The debrief of a run. `causes` are those of a `part` that is not round enough, largest first.

    `diagnosis` compares what may be wrong by the parts so far; None where the record does not tell. `worse` is
    why compensation is advised against. `along` is why the sections of a part that fails differ, `off_um` the
    deviation of its diameter, None if within its tolerance or not judged; `unknown` are the gaps of the record.
    """

    happened: tuple[Incident, ...]
    part: RecordedPart | None
    fails_round: bool
    off_um: float | None
    causes: tuple[Cause, ...]
    diagnosis: FaultDiagnosis | None
    worse: tuple[Problem, ...]
    along: tuple[LengthCause, ...]
    unknown: tuple[Problem, ...]
    advice: tuple[Advice, ...]


def run_debrief(story: RunStory, data: Path, *, explains: bool = True) -> RunDebrief:
    """Return the debrief of a run; learned versions are those of the data folder. It raises nothing.

    Unless it `explains`, causes are left for later: to find them takes a second of numerics.
    """
    part = story.product
    judged = part is not None and part.passed is not None and part.tolerance_um is not None
    fails_round = judged and part is not None and part.is_round is False
    causes: tuple[Cause, ...] = ()
    diagnosis: FaultDiagnosis | None = None
    earlier = _earlier(story, data) if explains and part is not None else ()
    unknown = list(_unknown(story, part))
    if fails_round and not explains:
        unknown.append(Problem(code="debrief.later"))
    elif part is not None and fails_round:
        try:
            causes = _taught(story, part, data).causes
        except ProblemError as error:
            unknown += error.problems
    if explains and part is not None:
        diagnosis = _diagnosis((*earlier, story), data)
    happened = tuple(_list_events(story))
    size = None if part is None else part.figure(ToleranceKind.DIAMETER)
    off_um = size.value_um if size is not None and size.passes is False else None
    found = RunDebrief(
        happened=happened,
        part=part,
        fails_round=fails_round,
        off_um=off_um,
        causes=causes,
        diagnosis=diagnosis,
        worse=_worse((*earlier, story)),
        along=causes_of_failure(part.length_causes, part.judged)
        if part is not None and part.passed is False
        else (),
        unknown=tuple(unknown),
        advice=(),
    )
    stopped = story.row.ended.how in FAILED_HOW - {RunOutcome.HELD}
    none = Advice.STOPPED if stopped else Advice.NONE
    return replace(found, advice=tuple(_advice(story, found)) or (() if found.worse else (none,)))


def _taught(story: RunStory, part: RecordedPart, data: Path) -> LearningOutcome:
    """Return what a part teaches. Raises ProblemError: the record does not suffice."""
    trace, job = part.read_trace(), story.read_job()
    if trace is None or job is None or story.machine_text is None:
        raise SessionError()
    machine = _machine(story)
    cuts = [(event.kind, json.dumps(dict(event.data)), "") for event in _ends(story)]
    made = made_with({}, trace.meta, parts_made(cuts))
    return learn_from_part(
        trace,
        LoadedJob(job=job, path=Path(story.row.job), sha256=story.job_sha256, text=story.job_text or ""),
        LoadedMachine(machine=machine, path=Path(story.row.machine), sha256=story.machine_sha256),
        data,
        made,
        gain=None,
        robust=False,
        date=part.at.isoformat(),
        tool_um=tool_lobe_um(cuts[-1][1]) if cuts else 0j,
    )


def _machine(story: RunStory) -> MachineProfile:
    return machine_from_table(parse_toml((story.machine_text or "").encode("utf-8", "replace"), ""))


def _lathe(story: RunStory) -> object:
    """Return which simulated lathe has cut it, None on a real one."""
    lathe = story.setup.get(LATHE)
    return lathe.get(WHICH) if isinstance(lathe, dict) else None


def _earlier(story: RunStory, data: Path) -> tuple[RunStory, ...]:
    """Return the runs before this one of the same job on the same machine as they are, oldest first."""
    row, found = story.row, list[RunStory]()
    try:
        filters = RunFilters(job=row.job, machine=row.machine, simulated=row.simulated)
        for each in runs(data, filters, before=row.run_id, limit=MOST_EARLIER):
            of = read_story(data, each.run_id)
            same = (of.job_sha256, of.machine_sha256) == (story.job_sha256, story.machine_sha256)
            if same and _lathe(of) == _lathe(story) and of.product is not None:
                found.append(of)
    except SessionError:
        return ()
    return tuple(reversed(found))


def _diagnosis(stories: Sequence[RunStory], data: Path) -> FaultDiagnosis | None:
    """Return the hypotheses on the parts of a job, None where the record of the last part does not suffice."""
    parts = list[PartEvidence]()
    for place, story in enumerate(stories):
        part = story.product
        try:
            seen = None if part is None else _taught(story, part, data).evidence
        except ProblemError:
            seen = None
        if part is not None and seen is not None:
            parts.append(_with_record(seen, part, story, place))
    last = stories[-1]
    if not parts or parts[-1].place != len(stories) - 1 or (job := last.read_job()) is None:
        return None
    machine = _machine(last)
    orders = [job.jaws * each for each in MULTIPLES if each % 2]
    hz = [each * job.spindle_speed_rpm / 60.0 for each in orders]
    yields = compliance_um_per_n(loop_of(machine), machine.tool.loop_gain_n_per_v, hz)
    lathe = KnownLathe(
        lobes=job.jaws,
        lobe_um=free_state_lobe(job).harmonics[0].coefficient,
        jaw_1_deg=job.jaw_1_deg,
        yields_um_per_n=dict(zip(orders, yields.tolist(), strict=True)),
    )
    return diagnose(parts, lathe)


def _with_record(seen: PartEvidence, part: RecordedPart, story: RunStory, place: int) -> PartEvidence:
    """Return the evidence of a part with its size, its sections, and whether its feed was held."""
    along = sorted(part.sections, key=lambda each: each.z_mm)
    off_um = part.off_nominal_um
    return replace(
        seen,
        size_um=None if off_um is None else 0.5 * off_um,
        taper_um=along[-1].mean_um - along[0].mean_um if len(along) > 1 else None,
        held=any(event.kind == HELD_AT for event in story.events),
        place=place,
    )


def _worse(stories: Sequence[RunStory]) -> tuple[Problem, ...]:
    """Return `learning.worse` if the last parts with compensation are all less round than those without."""
    parts = [(story.row.strategy in _PLAIN, story.product) for story in stories]
    of = {kind: [p.ront_um for plain, p in parts if plain is kind and p and p.ront_um] for kind in (True, False)}
    return worse_than_plain(of[True], of[False][-LAST_PARTS:])


def _ends(story: RunStory) -> tuple[RunEvent, ...]:
    return tuple(event for event in story.events if event.kind in ("cut", "result"))


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
    if not any("tool_lobe_um" in event.data for event in _ends(story)):
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
    if found.causes or found.along:
        yield Advice.CAUSES
    elif found.fails_round and story.row.strategy in _PLAIN:
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
