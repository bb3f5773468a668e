"""Arm, start, hold and retract: one cut of one part, on the operator's commands."""

from __future__ import annotations

from dataclasses import replace

from console.session.cut.alignment import aligned_job, problems
from console.session.cut.compensated import compensation_problems, path_of, stored_problems
from console.session.cut.engine import CutEnd, NotAsPlannedError, Step, cut, load
from console.session.cut.run import planned, refuse_unplannable
from console.session.data.calibrated_chuck import calibrations_of
from console.session.data.learned_store import NONE
from console.session.data.made_parts import AS_FILED, MODEL, MadeWith
from console.session.data.records import begin_record
from console.session.errors import SessionError, refuse
from console.session.stages import Stage
from console.session.station.commands import Arm, Disarm, Retract, Start
from console.session.station.context import StationContext
from console.session.station.jogging import no_retract
from console.session.station.progress import CutProgress, CutStage, CutWatch
from console.session.station.state import Activity, Armed, TouchedBlank
from drivers.cutting.planning import CutPlan, first_spindle_counts
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.problem import Problem, ProblemError

START_WITHIN_S = 10.0  # how long after arming a cut may be started


def arm(place: StationContext, command: Arm) -> None:
    """Check everything, load the program and read it back. Nothing moves; start is allowed for some seconds."""
    place.tell(armed=None)
    place.lathe.program.put_back()
    alignment, context, strategy = place.state.alignment, place.context, command.strategy
    job = aligned_job(command.job, alignment)
    refuse(problems(alignment, command.job))
    also = _learned(place, command), context.commissioned(context.lathe.snapshot())
    refuse_unplannable(job, place.machine, strategy, *also, jaw_found=True, simulated=context.simulated)
    plan = _planned(place, command, job)
    load(context, plan, lambda *_: None, aligned=True)
    jaw, learned = place.state.alignment.jaw, command.compensation
    made = MadeWith(
        compensation=NONE if learned is None else str(learned.version),
        strategy=strategy.value,
        stage=Stage(command.stage).value,
        inverted=MODEL,
        cut_jaw_1_deg=AS_FILED if jaw is None else str(jaw.angle_deg),
    )
    _open_record(place, command, plan, made)
    place.plan = plan
    armed = Armed(
        job=job,
        strategy=strategy,
        plan=plan,
        alignment=place.state.alignment,
        until_s=place.clock.now_s() + START_WITHIN_S,
        made=made,
        loaded=command.loaded,
    )
    place.tell(armed=armed)


def _learned(place: StationContext, command: Arm) -> tuple[Problem, ...]:
    """Check the learned version again: it may have been chosen some time ago, and files may have changed."""
    learned, loaded = command.compensation, command.loaded
    problems = compensation_problems(
        learned,
        loaded if loaded is not None and loaded.job == command.job else None,
        place.loaded_machine,
        command.strategy,
        Stage(command.stage),
        simulated=place.shop is not None,
    )
    return problems if learned is None else (*problems, *stored_problems(learned, place.records))


def _planned(place: StationContext, command: Arm, job: Job) -> CutPlan:
    """Plan the cut; nothing has been sent, so every objection is a refusal."""
    strategy, machine, stage = command.strategy, place.machine, Stage(command.stage)
    path = path_of(job, command.job, command.compensation)
    # From the whole turn nearest to the spindle position: each cut leaves it some hundreds further on.
    start = first_spindle_counts(job, machine, strategy)
    turn = round((place.lathe.snapshot().spindle.position - start) / machine.spindle.counts_per_rev)
    watchdog = place.lathe.program.watchdog
    try:
        return planned(job, machine, strategy, stage, path, watchdog=watchdog, from_turn=turn)
    except ProblemError as refused:
        raise SessionError(*refused.problems) from refused


def disarm(place: StationContext, _: Disarm) -> None:
    """Disarm, and undo what arming has changed on the controller."""
    place.tell(armed=None)
    place.lathe.program.put_back()


def start(place: StationContext, _: Start) -> None:
    """Run the armed cut; refused where nothing is armed, else as `cut`."""
    armed = place.state.armed
    if armed is not None and place.clock.now_s() > armed.until_s:
        armed = None
    if armed is not None:
        refuse(problems(place.state.alignment, armed.job))
    if armed is None or place.state.alignment != armed.alignment:
        place.tell(armed=None)
        raise SessionError(Problem(code="session.not_armed"))
    place.started = armed
    place.tell(armed=None, cut=None, cut_done=False, measured=None)
    watched = _Watched(place, armed)
    place.seen = watched.publish
    try:
        end = cut(place.context, armed.job, armed.plan, watched.step, watched.see)
    except NotAsPlannedError as early:
        place.note("ended_early", turns=early.turns, reasons=[problem.code for problem in early.problems])
        raise
    finally:
        place.seen = None
    _finish(place, watched, end)


class _Watched:
    """Publish a cut to the screens, and pass the operator's hold to the program."""

    def __init__(self, place: StationContext, armed: Armed) -> None:
        self._place, self._strategy, self._stage = place, armed.strategy, CutStage.POSITION
        self.watch = CutWatch(armed.plan, armed.job, place.machine, in_air=armed.made.stage == Stage.AIR)

    def step(self, step: Step, detail: str) -> None:
        if step is Step.CUT:
            self._place.note("started", strategy=self._strategy.value)
            self._stage = CutStage.RUN_UP
            self._place.tell(activity=Activity.CUTTING)

    def see(self, snapshot: Snapshot) -> None:
        """Pass the operator's hold on, once, between two polls of the program."""
        place = self._place
        if place.end_asked and not place.lathe.program.held:
            place.lathe.program.end_after_turn()

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a status poll, in whatever wait it was made."""
        place = self._place
        seen = self.watch.see(snapshot, self._stage, place.lathe.program.held, place.state.spindle_rpm)
        place.tell(cut=seen, touched=_touched(seen, place.state.touched))


def _touched(cut: CutProgress, before: TouchedBlank | None) -> TouchedBlank | None:
    """Return how far the blank is cut after a moment of a cut; an interrupted cut leaves it a blank no longer."""
    if cut.stage is not CutStage.CUT or cut.in_air or (before is not None and before.to_mm >= cut.z_mm):
        return before
    return TouchedBlank(to_mm=cut.z_mm, of_mm=cut.length_mm)


def retract(place: StationContext, _: Retract) -> None:
    """Retract the tool until it is clear of the part, or by the retract distance where no part is known.

    A stop leaves the compensation table of a cut on. Then the carriage moves back, too, to where the table adds
    nothing, and the table is switched off there.

    Raises:
        DriverError: `machine.retract_direction`, the tool is out already.
    """
    snapshot = place.lathe.snapshot()
    refused = no_retract(snapshot, place.loaded_machine.machine, place.state.alignment)
    if refused is not None:
        raise SessionError(refused)
    plan, tool = place.plan, place.machine.tool
    if plan is not None:
        target = plan.setup.retracted
    else:
        short = snapshot.tool.position - tool.retract_mm * tool.counts_per_mm
        target = max(short, tool.travel_min_mm * tool.counts_per_mm)
    place.lathe.retract(target)
    place.lathe.program.put_back()
    if place.lathe.program.tables_left():
        # Without a plan: the zero of the carriage lies ahead of every table.
        zero_z = 0.0 if plan is None or plan.zero_row_z is None else plan.zero_row_z
        place.lathe.jog_to(AxisName.CARRIAGE, zero_z, settle=False)
        refuse(place.lathe.program.switch_tables_off())


def _finish(place: StationContext, watched: _Watched, end: CutEnd) -> None:
    """Report how the cut has ended."""
    stage = CutStage.HELD if end.held else CutStage.DONE
    ended = watched.watch.see(end.last, stage, end.held, place.state.spindle_rpm)
    # An air cut has not touched the part: it is as good a blank as before.
    place.tell(cut=replace(ended, figures=end.figures), cut_done=not end.held and not ended.in_air)
    made = {} if place.started is None else place.started.made.event()
    place.note("held" if end.held else "cut", turn=ended.turn, tool_error_peak_um=ended.tool_error_peak_um, **made)


def _open_record(place: StationContext, command: Arm, plan: CutPlan, made: MadeWith) -> None:
    place.end_record()
    job, machine, jaw = command.job, place.loaded_machine, place.state.alignment.jaw
    sha256, simulated = command.job_sha256, place.context.simulated
    place.record = begin_record(place.records, job.name, sha256, machine, plan, simulated=simulated)
    place.note(
        "armed",
        force_n=job.chucking_force_n,
        jaw_1_deg=None if jaw is None else jaw.angle_deg,
        calibrations=calibrations_of(machine),
        **made.event(),
    )
