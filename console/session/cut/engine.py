"""One cut of one part: load, verify, approach, arm, start, monitor, end, compare with its plan, prove clear.

The screens and `console run` cut with `load` and `cut`. `load` puts the program into the controller without
motion; `cut` returns only when the planned cut has been made, the tool is proven to be clear, and the controller
is set again as its profile says. Where either fails, the caller stops the machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Protocol

from console.session.cut.cut_verdict import CutJudgement, ToolPolls
from console.session.cut.interlocks import SPEED_BAND, START_BAND_COUNTS, at_speed, of_machine
from console.session.cut.recording import CutRecorder
from console.session.cut.telemetry import CutFigures, Telemetry
from console.session.errors import SessionError, refuse
from drivers.cutting.bounds import UNTRIMMED
from drivers.cutting.feed_hold import MOST_HELD_S, HoldLedger, turns_back
from drivers.cutting.guarding import CutLength, cut_guard, end_problems, further_held
from drivers.cutting.live_trim import subtract_trim
from drivers.cutting.override import PaceLedger
from drivers.cutting.path_seen import CutBefore, PathSeen
from drivers.cutting.planning import CutPlan
from drivers.errors import DriverError, LinkError
from drivers.lathe.lathe import SPEED_S, Lathe
from drivers.lathe.lengths import Lengths
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import way_problems
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.compensations.trial_band import BandReadings
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.metrology.cylindricity import PartSection
from profiles.metrology.uncertainty import KnownGauge
from profiles.problem import Problem
from profiles.traces import Trace

TIME_ALLOWANCE = 1.5
EXTRA_TIME_S = 5.0
"""Timeout margin of a program over its planned time: this factor, plus this time."""

RETRACT_BAND_COUNTS = 50.0
SPINDLE_TIMEOUT_S = 120.0
STILL_RPM = 0.1


class PartStep(StrEnum):
    """Steps of a part in order."""

    LOAD = "load"
    CHECK = "check"
    ALIGN = "align"
    ARM = "arm"
    CUT = "cut"
    RETRACT = "retract"
    MEASURE = "measure"


Tell = Callable[[PartStep, str], None]
"""Called at the beginning of every step, with a detail that needs no translation."""

See = Callable[[Snapshot], None]
"""Called with every status poll while the program runs."""


class Workshop(Protocol):
    """Simulated workshop: chuck, gauge, and the switch of an inverter-driven spindle."""

    def mount(self, job: Job) -> None:
        """Clamp a new blank."""

    def measure(self, *, turned_deg: float = 0.0) -> Trace:
        """Release the part and measure it, turned on the gauge by so much in the direction of its angles."""

    def sections(self) -> tuple[PartSection, ...]:
        """Return sections of the part that was measured, along its cut."""

    def indicate(self, places: int | None = None) -> ClampReadings:
        """Return what an indicator on the clamped part shows, finger-tight and at full force.

        The `places` count from jaw 1; None is as many as the lobe needs, from the spindle index.
        """

    def indicate_band(self, behind_face_mm: float) -> BandReadings:
        """Return what the indicator shows of the clamped part so far behind its face, where it was cut."""

    def look(self) -> WorkshopView:
        """Return what can be seen at the chuck."""

    def set_spindle(self, rpm: float | None) -> None:
        """Set a spindle that the controller does not drive, rpm; None switches it off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutContext:
    """One machine. Without a `workshop` the operator clamps, measures and sets the spindle.

    `commissioned` returns every reason why the machine, as the snapshot shows it, may not cut. Whoever connects
    for one cut alone calls `admit` once the controller answers, before anything is written. `sets_spindle` says
    that the workshop sets the spindle for the cut and switches it off afterwards. `recorder` keeps the telemetry.
    `gauge` is what the parts are measured on, None if it is not stated; its known error is taken off them.
    """

    lathe: Lathe
    workshop: Workshop | None = None
    commissioned: Callable[[Snapshot], tuple[Problem, ...]] = lambda _: ()
    admit: Callable[[], None] = lambda: None
    sets_spindle: bool = False
    recorder: CutRecorder = field(default_factory=CutRecorder)
    gauge: KnownGauge | None = None

    @property
    def simulated(self) -> bool:
        """Whether the machine is simulated."""
        return self.workshop is not None

    def held_s(self) -> float:
        """Return by how much a simulated lathe has held its time in all, while this computer was busy."""
        return 0.0 if self.workshop is None else self.workshop.look().held_s


@dataclass(frozen=True, slots=True, kw_only=True)
class CutEnd:
    """End of a cut: `last` proves that the tool is clear. `figures` is None if a hold left too few polls."""

    last: Snapshot
    figures: CutFigures | None
    held: bool


class NotAsPlannedError(DriverError):
    """The cut differs from its plan; `turns` is how many were cut, None while nobody could ask the controller."""

    judgement = CutJudgement.DISTURBED

    def __init__(self, *problems: Problem, turns: float | None) -> None:
        super().__init__(*problems)
        self.turns = turns


def load(context: CutContext, plan: CutPlan, tell: Tell, *, aligned: bool) -> None:
    """Load the program of a cut and read it back, on a machine that is set as its profile says. Nothing moves.

    `aligned` means that the drives are enabled and the axes homed: all but their positions must then be as for the
    start. Raises SessionError: what forbids the cut; DriverError: a line was refused, or something else is held.
    """
    lathe = context.lathe
    refuse(lathe.program.tables_left())  # none may add to the tool position, or have left an offset
    lathe.program.load(plan.program, plan.axis_definitions, plan.restore)
    tell(PartStep.CHECK, f"PROG {plan.program.number}")
    refuse(_unready(lathe, plan, at_start=False) if aligned else lathe.verify())


def cut(
    context: CutContext,
    job: Job,
    plan: CutPlan,
    tell: Tell,
    see: See,
    *,
    settle_tool: bool = True,
    touched_mm: float = 0.0,
) -> CutEnd:
    """Go to the start, tool last, verify everything again, cut, and prove that the tool is clear of the part.

    Without `settle_tool` the tool is known to stand at its start, with its integrator as the last cut left it.
    The blank was cut before, to `touched_mm` behind its face as last seen; 0 for a fresh one.

    Raises:
        SessionError: an interlock that is not met; `session.nothing_seen`, `machine.not_retracted`.
        NotAsPlannedError: how the cut differs from its plan: such a part is neither measured nor learned from.
        DriverError: what ended the cut.
        StoppedError: somebody stopped the machine.
    """
    lathe = context.lathe
    lathe.program.note_settings()
    _refuse_changed(context, plan)
    _go_to_start(lathe, plan, settle_tool=settle_tool)
    _turn(context, job.spindle_speed_rpm)
    tell(PartStep.ARM, f"{plan.spindle_speed_rpm:.6g} rpm")
    allowed = context.commissioned(lathe.snapshot())
    refuse(_unready(lathe, plan, at_start=True), allowed, at_speed(lathe, job))
    refuse(_changes(lathe, plan))  # somebody else may have changed what was loaded
    tell(PartStep.CUT, f"{plan.duration_s:.1f} s")
    figures = _recorded_run(context, job, plan, see, touched_mm)
    if figures is None and not lathe.program.held:
        raise SessionError(nothing_seen(job))
    refuse(lathe.program.tables_left())  # none may add to the tool position, or have left an offset
    tell(PartStep.RETRACT, "")
    last = lathe.snapshot()
    if not last.at_rest or not tool_clear(last, plan):
        axis, places = AxisName.TOOL, (last.tool.position, _clear_of(plan))
        value, limit = (Lengths(lathe.machine).format_position(axis, place) for place in places)
        raise SessionError(Problem(code="machine.not_retracted", key=axis, value=value, limit=f"< {limit}"))
    _turn(context, 0.0)
    lathe.stop.check()  # a stop at the last moment must not be lost in a report
    return CutEnd(last=last, figures=figures, held=lathe.program.held)


def _recorded_run(context: CutContext, job: Job, plan: CutPlan, see: See, touched_mm: float) -> CutFigures | None:
    recorder = context.recorder

    def polled(snapshot: Snapshot) -> None:
        recorder.see(snapshot)
        see(snapshot)

    recorder.begin(plan, job, context.lathe.machine)
    try:
        figures = _run(context, job, plan, polled, touched_mm)
    finally:
        recorder.end()
    if figures is not None:
        recorder.record_verdict(figures.verdict)
    return figures


def _run(context: CutContext, job: Job, plan: CutPlan, see: See, touched_mm: float) -> CutFigures | None:
    """Run the program to its end, and compare the cut with its plan: only the planned cut makes a good part.

    Compared are turns and length, the program with its constants and tables, the settings, and the polled path,
    which shows a change that somebody has reverted: one of a moment by the other turns, one of the whole feed by
    the plan. What this console has changed is taken out of it: a feed hold, which takes whole turns with the tool
    out; an override, by the time of the program; a trim.
    """
    lathe, held_s = context.lathe, context.held_s()
    telemetry = Telemetry(plan, lathe.machine, job)
    length, path = (
        CutLength(plan, lathe.machine),
        PathSeen(plan, lathe.machine, _find_earlier_cut(lathe, plan, touched_mm)),
    )
    tool, guard = ToolPolls(plan, lathe.machine, job), cut_guard(plan, lathe.machine)
    ledger = HoldLedger(lathe.machine.spindle.counts_per_rev, turns_back(plan, lathe.machine))
    guard.expected_percent, pace = lathe.program.override.expected_range, PaceLedger(plan.setup.carriage_face)

    def polled(snapshot: Snapshot) -> None:
        lathe.program.hold.read()
        lathe.program.live_trim.read()
        paced = snapshot if plan.strategy.traits.spindle_time else pace.see(snapshot)
        unheld = ledger.see(paced, lathe.program.hold.report)
        if not lathe.program.hold.report.active:
            length.see(snapshot)
        if unheld is None:
            guard.further = {AxisName.SPINDLE: math.inf}
        elif ledger.turns:
            guard.further = further_held(plan, lathe.machine, ledger.turns)
        if unheld is not None:
            telemetry.see(unheld, holding=lathe.program.held)
            if not lathe.program.held:  # while retracting, the tool is on no path of a turn
                trim = lathe.program.live_trim.applied
                as_planned = subtract_trim(unheld, plan, lathe.machine, trim)
                path.see(as_planned)
                tool.see(as_planned, trimmed=trim != UNTRIMMED)
        see(snapshot)

    lathe.begin_witness(tool.feed)
    lathe.program.start(plan.program.number, plan.setup.retracted, plan.target.lobes)
    lathe.program.follow(polled, plan.duration_s * TIME_ALLOWANCE + EXTRA_TIME_S, guard, _clear_of(plan))
    verdict = tool.verdict(None if lathe.witness is None else lathe.witness.report(), unheld=not guard.further)
    lathe.program.put_back()
    _refuse_another(lathe, plan, length, (*verdict.changes, *path.problems(context.held_s() - held_s)))
    figures = telemetry.figures()
    if verdict.judgement is CutJudgement.DISTURBED:
        raise NotAsPlannedError(*verdict.problems, turns=lathe.program.end().turns)
    figures = figures and replace(figures, push_um=0.0 if ledger.turns else figures.push_um)  # a hold renews it
    return figures and replace(figures, spindle_speed_rpm=pace.mean * figures.spindle_speed_rpm, verdict=verdict)


def _find_earlier_cut(lathe: Lathe, plan: CutPlan, touched_mm: float) -> CutBefore | None:
    """Return how far the blank was cut before: the controller ends a cut whose host is lost some turns later."""
    if not touched_mm:
        return None
    unseen_turns = 1.0 + lathe.ends_within_s * plan.spindle_speed_rpm / 60.0
    per_turn_mm = plan.setup.carriage_per_turn / lathe.machine.carriage.counts_per_mm
    return CutBefore(to_mm=touched_mm, unseen_mm=unseen_turns * per_turn_mm)


def _refuse_another(lathe: Lathe, plan: CutPlan, length: CutLength, off_path: Iterable[Problem]) -> None:
    """Refuse a cut that has ended and is not the planned one, with `NotAsPlannedError`."""
    end = lathe.program.end()
    if not end.finished:  # a program that was ended in mid-turn no longer reports its turns
        end = replace(end, turns=length.turns)
    early = end_problems(plan, end, length, held=lathe.program.held)
    if early and lathe.program.hold.report.active:  # nobody has resumed it
        early = (*early, Problem(code="cut.hold_lapsed", limit=f"{MOST_HELD_S / 60.0:g} min"))
    trimmed = () if lathe.program.live_trim.problem is None else (lathe.program.live_trim.problem,)
    changed = (*early, *trimmed, *_changes(lathe, plan, ended=True), *lathe.verify())
    if problems := changed or tuple(off_path):
        raise NotAsPlannedError(*problems, turns=end.turns)


def _refuse_changed(context: CutContext, plan: CutPlan) -> None:
    """Refuse any motion on a machine that has changed since loading: safety devices, settings, program."""
    lathe = context.lathe
    devices = device_problems(lathe.snapshot().inputs)
    refuse(devices, way_problems(lathe.stop.way))
    refuse(_unready(lathe, plan, at_start=False))
    refuse(_changes(lathe, plan, tables=False))  # the table is read after the move to the start


def _changes(lathe: Lathe, plan: CutPlan, *, tables: bool = True, ended: bool = False) -> tuple[Problem, ...]:
    """Return what differs from the cut as loaded; a broken link is raised."""
    try:
        lathe.program.holds(plan.program, tables=tables, ended=ended)
    except LinkError:
        raise
    except DriverError as changed:
        return tuple(changed.problems)
    return ()


def _unready(lathe: Lathe, plan: CutPlan, *, at_start: bool) -> tuple[Problem, ...]:
    snapshot = lathe.snapshot()
    return (*lathe.verify(), *of_machine(snapshot, plan, lathe.machine, at_start=at_start))


def _go_to_start(lathe: Lathe, plan: CutPlan, *, settle_tool: bool) -> None:
    """Move every axis to its start: the tool out first, and in again last, beside the part."""
    if lathe.snapshot().tool.position > plan.setup.retracted + START_BAND_COUNTS:
        lathe.retract(plan.setup.retracted)
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    if AxisName.SPINDLE in lathe.driven:
        lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    lathe.jog_to(AxisName.TOOL, plan.tool_start, settle=settle_tool)


def _turn(context: CutContext, speed_rpm: float) -> None:
    """Set a spindle that the controller does not drive, and wait for its speed; 0 is off."""
    if context.workshop is None or not context.sets_spindle:
        return
    context.workshop.set_spindle(speed_rpm or None)
    for _ in range(round(SPINDLE_TIMEOUT_S / SPEED_S)):
        if abs(context.lathe.spindle_rpm() - speed_rpm) <= max(SPEED_BAND * speed_rpm, STILL_RPM):
            return


def nothing_seen(job: Job) -> Problem:
    """Return the problem that too few polls fell into a cut to judge it."""
    return Problem(code="session.nothing_seen", key="cut_length_mm", value=f"{job.cut_length_mm:g} mm")


def _clear_of(plan: CutPlan) -> float:
    return plan.setup.surface - RETRACT_BAND_COUNTS


def tool_clear(snapshot: Snapshot, plan: CutPlan) -> bool:
    """Whether the tool is out of the part of this cut."""
    return snapshot.tool.position < _clear_of(plan)
