"""What the record of a job's parts says of faults: the hypotheses, and whether compensation makes them worse.

For the debrief of a run, the page Inspect and `console learn` alike.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from console.session.data.measured_part import RecordedPart, made_with, parts_made, tool_lobe_um
from console.session.data.run_reader import RunFilters, runs
from console.session.data.run_reader import story as read_story
from console.session.data.run_story import RunEvent, RunStory
from console.session.errors import SessionError
from console.session.learning.learning_steps import RecordedCut, evidence_from
from console.session.learning.row_result import worse_than_plain
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.which_lathe import LATHE, WHICH
from profiles.axis.sampled_loop import loop_of
from profiles.axis.stiffness import compliance_um_per_n
from profiles.compensations.hypotheses import MULTIPLES, FaultDiagnosis, KnownLathe, PartEvidence, diagnose
from profiles.compensations.path import PathHarmonic, free_state_lobe
from profiles.files import parse_toml
from profiles.job import Job
from profiles.machine import MachineProfile, machine_from_table
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, LoadedMachine
from profiles.strict_values import number

MOST_EARLIER, MOST_COMPARED, LAST_PARTS = 8, 5, 3
"""Parts looked up before the last one, those whose evidence is compared, and those that are all to be worse."""

HELD_AT = "held_at"
PLAIN = frozenset(each.value for each in Strategy if not each.traits.follows_lobe)


@dataclass(frozen=True, slots=True, kw_only=True)
class RowFaults:
    """The hypotheses on the last part, None if the record does not tell; why compensation is advised against.

    `unknown` is why the record does not tell.
    """

    diagnosis: FaultDiagnosis | None = None
    worse: tuple[Problem, ...] = ()
    unknown: tuple[Problem, ...] = ()


NO_FAULTS = RowFaults()


def find_faults(
    story: RunStory, data: Path, *, explains: bool = True, evidence: PartEvidence | None = None
) -> RowFaults:
    """Return what a run and those before it say; without `explains` only whether the parts are made worse.

    `evidence` is that of its part where it is known already. It raises nothing of what a record lacks.
    """
    stories = (*_earlier(story, data), story)
    worse = _worse(stories)
    if not explains:
        return RowFaults(worse=worse)
    try:
        return RowFaults(diagnosis=_diagnosis(stories, data, evidence), worse=worse)
    except ProblemError as error:
        return RowFaults(worse=worse, unknown=tuple(error.problems))


def diagnose_parts(parts: Sequence[PartEvidence], job: Job, machine: MachineProfile) -> FaultDiagnosis:
    """Return the hypotheses on parts of a job on a machine, oldest first, at least one of them."""
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


def recorded_cut(story: RunStory, part: RecordedPart) -> RecordedCut:
    """Return a part with its cut, as recorded. Raises ProblemError: the record does not suffice."""
    trace, job = part.read_trace(), story.read_job()
    if trace is None or job is None or story.machine_text is None:
        raise SessionError()
    machine = machine_of(story)
    cuts = [(event.kind, json.dumps(dict(event.data)), "") for event in ends_of(story)]
    return RecordedCut(
        trace=trace,
        job=LoadedJob(job=job, path=Path(story.row.job), sha256=story.job_sha256, text=story.job_text or ""),
        machine=LoadedMachine(machine=machine, path=Path(story.row.machine), sha256=story.machine_sha256),
        made=made_with({}, trace.meta, parts_made(cuts)),
        tool_um=tool_lobe_um(cuts[-1][1]) if cuts else 0j,
    )


def machine_of(story: RunStory) -> MachineProfile:
    """Return the machine of a run, as recorded; ProblemError: it cannot be read."""
    return machine_from_table(parse_toml((story.machine_text or "").encode("utf-8", "replace"), ""))


def ends_of(story: RunStory) -> tuple[RunEvent, ...]:
    """Return the events that end a cut."""
    return tuple(event for event in story.events if event.kind in ("cut", "result"))


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


def _diagnosis(stories: Sequence[RunStory], data: Path, evidence: PartEvidence | None) -> FaultDiagnosis | None:
    """Return the hypotheses on the last part; raises ProblemError, why the record of that does not tell."""
    made = [(story, part) for story in stories for part in parts_of(story)][-MOST_COMPARED:]
    parts, last, job = list[PartEvidence](), stories[-1], stories[-1].read_job()
    for place, (story, part) in enumerate(made):
        is_last = place == len(made) - 1
        try:
            seen = evidence if is_last and evidence is not None else _evidence_of(story, part, data)
        except ProblemError:
            if is_last:
                raise
            continue
        parts.append(_with_record(seen, part, story, place))
    if job is None or not parts_of(last):
        return None
    return diagnose_parts(parts, job, machine_of(last))


def parts_of(story: RunStory) -> list[RecordedPart]:
    """Return the parts that a run was for: all those of a row that learns, else the last."""
    made = [part for part in story.parts if part.product]
    return made if made and _number(made[0]) else made[-1:]


def _number(part: RecordedPart) -> int:
    """Return which part of a row that learns it is, from 1; 0 of one that is in no row."""
    counted = part.part.partition(" ")[2]
    return int(counted) if counted.isdecimal() else 0


def _evidence_of(story: RunStory, part: RecordedPart, data: Path) -> PartEvidence:
    """Return what a part is for a diagnosis; of a row that learns with its own path, which the result of that has.

    Raises ProblemError: the record does not suffice.
    """
    of = recorded_cut(story, part)
    seen, place = evidence_from(of, data), _number(part)
    if not place:
        return seen
    try:
        learned = [event.data["passes"] for event in ends_of(story)][-1][place - 1]["learned"]
        path_um, off_um = (_order_um(learned[name], of.job.job.jaws) for name in ("wanted", "tool_error"))
    except (LookupError, TypeError, ValueError) as error:
        raise SessionError(Problem(code="debrief.no_tool_error")) from error
    return replace(seen, path_um=path_um, tool_um=-off_um)


def _order_um(waves: Sequence[Mapping[str, Any]], order: int) -> complex:
    """Return an order of recorded undulations, um; raises ValueError: its figures are no numbers."""
    found = (
        PathHarmonic(lobes=order, amplitude_um=number(each["amplitude_um"]), phase_deg=number(each["crest_deg"]))
        for each in waves
        if each["n"] == order
    )
    return sum((each.coefficient for each in found), 0j)


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
    parts = [(story.row.strategy in PLAIN, part.ront_um) for story in stories for part in parts_of(story)]
    of = {kind: [um for plain, um in parts if plain is kind and um] for kind in (True, False)}
    return worse_than_plain(of[True], of[False][-LAST_PARTS:])
