"""A recorded event made ready to practise: the lathe as it stood before, the fault that comes, what differs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from console.flight.recorded_forms import RecordedMoment, RecordedWork
from console.flight.recording import Recording
from console.school.practice.practice_start import PracticeStart, RecordedEvent, event_of, find_practice_start
from console.session.cut.alignment import Alignment, aligned_machine
from console.session.data.measured_part import MODEL
from console.session.station.jogging import tool_in_part
from console.session.station.state import SessionStart
from drivers.lathe_placement import LathePlacement
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, refusal_error

_BLANK = ("jaws", "material", "diameter_mm", "wall_thickness_mm", "overhang_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Practice:
    """What is practised. `otherwise` is what differs from what was recorded, each as one sentence."""

    recording: Recording
    event: RecordedEvent
    before: PracticeStart
    placed: LathePlacement
    begins: SessionStart
    otherwise: tuple[Problem, ...]

    @property
    def work(self) -> RecordedWork | None:
        """The job to open, None if none was open."""
        return self.before.work


def practice_of(recording: Recording, before_s: float | None = None) -> Practice:
    """Return the practice of the event of a recording.

    Raises:
        ProfileError: those of `find_practice_start`; `practice.no_job`, the event came in a cut whose job was not
        recorded.
    """
    event = event_of(recording)
    begin = find_practice_start(recording, event, before_s)
    if begin.of_cut and begin.work is None:
        raise refusal_error("practice.no_job")
    machine = recording.header.machine
    alignment = _alignment(begin)
    job = _clamped_job(begin, alignment)
    if alignment.clamping is not None and job is None:
        alignment = replace(alignment, clamping=None)
    placed = LathePlacement(
        axes=_axes(begin, machine),
        jaw_1_deg=None if alignment.jaw is None else alignment.jaw.angle_deg,
        tip_radius_mm=None
        if alignment.touch_off is None
        else aligned_machine(machine, alignment).tool.home_radius_mm,
        job=job,
    )
    return Practice(
        recording=recording,
        event=event,
        before=begin,
        placed=placed,
        begins=SessionStart(alignment=alignment, drives_on=alignment.drives_on),
        otherwise=tuple(_list_differences(recording, event, begin, placed)),
    )


def _alignment(begin: PracticeStart) -> Alignment:
    """Return the alignment at the beginning; of a cut that is older than its recording, that of its arming."""
    armed = begin.moment.state.armed
    return armed.alignment if begin.at_start and armed is not None else begin.moment.state.alignment


def _clamped_job(begin: PracticeStart, alignment: Alignment) -> Job | None:
    """Return the job whose blank is clamped, None if the recording does not have it."""
    clamping, work = alignment.clamping, begin.work
    if clamping is None or work is None:
        return None
    same = all(getattr(work.job, name) == getattr(clamping, name) for name in _BLANK)
    return work.job if same else None


def _axes(begin: PracticeStart, machine: MachineProfile) -> tuple[float, float, float] | None:
    """Return where the axes stood, mm and turns; None if the controller did not know."""
    state = begin.moment.state
    snapshot, armed = state.snapshot, state.armed
    if snapshot is None or not snapshot.homed:
        return None
    tool, carriage = snapshot.tool.position, snapshot.carriage.position
    if begin.at_start and armed is not None:
        tool, carriage = armed.plan.tool_start, armed.plan.carriage_start
    elif _tool_in_part(begin.moment, machine):
        tool = 0.0
    turns = snapshot.spindle.position / machine.spindle.counts_per_rev
    return tool / machine.tool.counts_per_mm, carriage / machine.carriage.counts_per_mm, turns % 1.0


def _tool_in_part(moment: RecordedMoment, machine: MachineProfile) -> bool:
    snapshot = moment.state.snapshot
    return snapshot is not None and tool_in_part(snapshot, machine, moment.state.alignment) is True


def _list_differences(
    recording: Recording, event: RecordedEvent, begin: PracticeStart, placed: LathePlacement
) -> Iterator[Problem]:
    yield from _of_machine(recording, begin, placed)
    yield from _of_part(recording, begin, placed)
    yield from _of_cut(recording, event, begin)
    yield from _of_fault(event)


def _of_machine(recording: Recording, begin: PracticeStart, placed: LathePlacement) -> Iterator[Problem]:
    header, state, alignment = recording.header, begin.moment.state, _alignment(begin)
    if not header.simulated:
        yield Problem(code="practice.was_real", key=header.machine.name)
    if placed.axes is None:
        yield Problem(code="practice.not_homed")
    elif begin.at_start:
        yield Problem(code="practice.at_start")
    elif _tool_in_part(begin.moment, header.machine):
        yield Problem(code="practice.tool_out")
    if alignment.jaw is not None or alignment.touch_off is not None:
        yield Problem(code="practice.as_found")
    if state.spindle_rpm and not begin.of_cut and abs(state.spindle_rpm) > 1.0:
        yield Problem(code="practice.spindle_stands", value=f"{state.spindle_rpm:.0f} rpm")
    if state.trial is not None:
        yield Problem(code="practice.trial")
    if not state.controls:
        yield Problem(code="practice.looked_on")
    active = (alarm.problem.code for alarm in state.alarms if alarm.active)
    yield from (Problem(code="practice.alarm_stood", value=code) for code in active)


def _of_part(recording: Recording, begin: PracticeStart, placed: LathePlacement) -> Iterator[Problem]:
    state = begin.moment.state
    if begin.work is None:
        yield Problem(code="practice.no_open_job")
    if _alignment(begin).clamping is not None and placed.job is None:
        yield Problem(code="practice.other_blank")
    if state.cut_to is not None and not begin.at_start:
        yield Problem(code="practice.fresh_blank", value=f"{state.cut_to.to_mm:.2f} mm")


def _of_cut(recording: Recording, event: RecordedEvent, begin: PracticeStart) -> Iterator[Problem]:
    if begin.during is None:
        return
    if not begin.of_cut:
        yield Problem(code="practice.move_yourself")
        return
    moments = recording.moments[recording.place_at(begin.at_s) : recording.place_at(event.at_s) + 1]
    yield Problem(code="practice.before_cut")
    made = next((each.state.armed.made for each in moments if each.state.armed is not None), None)
    if made is not None and made.version is not None:
        yield Problem(code="practice.learned", key=made.version)
    if made is not None and made.inverted != MODEL:
        yield Problem(code="practice.inverted", key=made.inverted)
    cuts = [each.state.cut for each in moments if each.state.cut is not None]
    if any(cut.holds_mm for cut in cuts):
        yield Problem(code="practice.held")
    if any(cut.adjusted.trim != cuts[0].adjusted.trim for cut in cuts) or any(
        cut.adjusted.override_percent != cuts[0].adjusted.override_percent for cut in cuts
    ):
        yield Problem(code="practice.adjusted")


def _of_fault(event: RecordedEvent) -> Iterator[Problem]:
    if event.like is None:
        yield Problem(code="practice.nothing_like_it")
        return
    if event.like.doubt:
        yield Problem(code=event.like.doubt)
    if "for=" in event.like.fault:
        seconds = event.like.fault.rpartition("for=")[2]
        yield Problem(code="practice.over_by_itself", value=f"{seconds} s")
