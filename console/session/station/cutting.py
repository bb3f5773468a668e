"""Arm, start, hold and retract: one cut of one part, on the operator's commands."""

from __future__ import annotations

from dataclasses import replace

from console.session.cut.alignment import problems
from console.session.cut.compensated import compensation_problems, path_of, stored_problems
from console.session.cut.context import CutContext
from console.session.cut.engine import CutEnd, NotAsPlannedError, Step, cut, load
from console.session.cut.interlocks import Interlock, refuse_unless
from console.session.cut.planning import planned, refuse_unplannable
from console.session.data.calibrated_chuck import calibrations_of
from console.session.data.learned_store import NONE
from console.session.data.made_parts import AS_FILED, MODEL, MadeWith
from console.session.data.records import begin_record
from console.session.errors import SessionError
from console.session.stages import Stage
from console.session.station.blank import touched_by
from console.session.station.commands import Arm, Disarm, Retract, Start
from console.session.station.context import StationContext
from console.session.station.jogging import no_retract
from console.session.station.progress import CutStage, CutWatch
from console.session.station.state import Activity, Armed
from drivers.cutting.planning import CutPlan, first_spindle_counts
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.problem import Problem, ProblemError

START_WITHIN_S = 10.0
"""How long after arming a cut may be started."""

AT_START = "at_start"


def arm(place: StationContext, command: Arm, job: Job) -> None:
    """Check everything, load the program and read it back. Nothing moves; start is allowed for some seconds.

    `job` is that of the command with jaw 1 where it was found.

    Raises:
        SessionError: every reason why this cut may not start.
    """
    place.tell(armed=None)
    place.lathe.program.put_back()
    refuse_unless(Interlock(name="aligned", problems=problems(place.state.alignment, command.job)))
    context, strategy = place.context, command.strategy
    also = _learned(place, command), _commissioned(context)
    refuse_unplannable(job, place.machine, strategy, *also, jaw_found=True, simulated=context.simulated)
    plan = _planned(place, command, job)
    load(context, plan, Unobserved(), aligned=True)
    armed = Armed(
        job=job,
        strategy=strategy,
        plan=plan,
        alignment=place.state.alignment,
        until_s=place.clock.now_s() + START_WITHIN_S,
        made=_made_with(place, command),
        loaded=command.loaded,
    )
    _open_record(place, command, armed)
    place.plan = plan
    place.tell(armed=replace(armed, until_s=place.clock.now_s() + START_WITHIN_S))


def _learned(place: StationContext, command: Arm) -> Interlock:
    """Check the learned version again: it may have been chosen some time ago, and files may have changed."""
    learned = command.compensation
    problems = compensation_problems(
        learned,
        command.loaded if command.loaded is not None and command.loaded.job == command.job else None,
        place.loaded_machine,
        command.strategy,
        Stage(command.stage),
        simulated=place.shop is not None,
    )
    if learned is not None:
        problems += stored_problems(learned, place.records)
    return Interlock(name="learned_holds", problems=problems)


def _planned(place: StationContext, command: Arm, job: Job) -> CutPlan:
    """Plan the cut; nothing has been sent, so every objection is a refusal.

    Raises:
        SessionError: the problems of `path_of` and `planned`.
    """
    strategy, machine, stage = command.strategy, place.machine, Stage(command.stage)
    path = path_of(job, command.job, command.compensation)
    turn, watchdog = _nearest_turn(place, job, command), place.lathe.program.watchdog
    try:
        return planned(job, machine, strategy, stage, path, watchdog=watchdog, from_turn=turn)
    except ProblemError as refused:
        raise SessionError(*refused.problems) from refused


def _made_with(place: StationContext, command: Arm) -> MadeWith:
    jaw, learned = place.state.alignment.jaw, command.compensation
    return MadeWith(
        compensation=NONE if learned is None else str(learned.version),
        strategy=command.strategy.value,
        stage=Stage(command.stage).value,
        inverted=MODEL,
        cut_jaw_1_deg=AS_FILED if jaw is None else str(jaw.angle_deg),
    )


def disarm(place: StationContext, _: Disarm) -> None:
    """Disarm, and undo what arming has changed on the controller."""
    place.tell(armed=None)
    place.lathe.program.put_back()


def start(place: StationContext, _: Start) -> None:
    """Run the armed cut.

    Raises:
        SessionError: not armed, or as `cut`.
        ProblemError: as `cut`.
    """
    armed = place.state.armed
    if armed is None or place.clock.now_s() > armed.until_s:
        place.tell(armed=None)
        raise SessionError(Problem(code="session.not_armed"))
    refuse_unless(Interlock(name="aligned", problems=problems(place.state.alignment, armed.job)))
    if place.state.alignment != armed.alignment:
        place.tell(armed=None)
        raise SessionError(Problem(code="session.not_armed"))
    place.started = armed
    place.tell(armed=None, cut=None, cut_done=False, measured=None)
    watched = _Watched(place, armed)
    place.seen = watched.publish
    try:
        end = cut(place.context, armed.job, armed.plan, watched)
    except NotAsPlannedError as early:
        place.note("ended_early", turns=early.turns, reasons=[problem.code for problem in early.problems])
        raise
    finally:
        place.seen = None
    _finish(place, watched, end)


class Unobserved:
    """Observer that ignores everything."""

    def step(self, step: Step, detail: str) -> None:
        """Do nothing."""

    def see(self, snapshot: Snapshot) -> None:
        """Do nothing."""


class _Watched:
    """Publish a cut to the screens, and pass the operator's hold to the program."""

    def __init__(self, place: StationContext, armed: Armed) -> None:
        self._place, self._strategy, self._stage = place, armed.strategy, CutStage.POSITION
        self.watch = CutWatch(armed.plan, armed.job, place.machine, in_air=armed.made.stage == Stage.AIR)

    def step(self, step: Step, detail: str) -> None:
        """Note that the program is about to run."""
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
        place.tell(cut=seen, touched=touched_by(seen, place.state.touched))


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
    tool = place.machine.tool
    if place.plan is not None:
        target = place.plan.setup.retracted
    else:
        target = max(
            snapshot.tool.position - tool.retract_mm * tool.counts_per_mm, tool.travel_min_mm * tool.counts_per_mm
        )
    place.lathe.retract(target)
    place.lathe.program.put_back()
    _leave_tables(place)


def _leave_tables(place: StationContext) -> None:
    if not place.lathe.program.tables_left():
        return
    plan = place.plan
    # Without a plan: the zero of the carriage lies ahead of every table.
    zero_z = 0.0 if plan is None or plan.zero_row_z is None else plan.zero_row_z
    place.lathe.jog_to(AxisName.CARRIAGE, zero_z, settle=False)
    refuse_unless(Interlock(name="no_table", problems=place.lathe.program.switch_tables_off()))


def _nearest_turn(place: StationContext, job: Job, command: Arm) -> int:
    """Return the whole turn nearest to the spindle position: each cut leaves it some hundreds further on."""
    start = first_spindle_counts(job, place.machine, command.strategy)
    return round((place.lathe.snapshot().spindle.position - start) / place.machine.spindle.counts_per_rev)


def _commissioned(context: CutContext) -> Interlock:
    return Interlock(name="commissioned", problems=context.commissioned(context.lathe.snapshot()))


def _finish(place: StationContext, watched: _Watched, end: CutEnd) -> None:
    """Report how the cut has ended."""
    stage = CutStage.HELD if end.held else CutStage.DONE
    ended = watched.watch.see(end.last, stage, end.held, place.state.spindle_rpm)
    # An air cut has not touched the part: it is as good a blank as before.
    done = not end.held and not ended.in_air
    place.tell(cut=ended if end.figures is None else ended.with_figures(end.figures), cut_done=done)
    made = {} if place.started is None else place.started.made.event()
    place.note("held" if end.held else "cut", turn=ended.turn, tool_error_peak_um=ended.tool_error_peak_um, **made)


def _open_record(place: StationContext, command: Arm, armed: Armed) -> None:
    place.end_record()
    machine = place.loaded_machine
    sha256, simulated = command.job_sha256, place.context.simulated
    place.record = begin_record(place.records, command.job.name, sha256, machine, armed.plan, simulated=simulated)
    used = calibrations_of(machine)
    force_n, made = command.job.chucking_force_n, armed.made.event()
    place.note("armed", force_n=force_n, jaw_1_deg=_jaw_deg(place), calibrations=used, **made)


def _jaw_deg(place: StationContext) -> float | None:
    jaw = place.state.alignment.jaw
    return None if jaw is None else jaw.angle_deg
