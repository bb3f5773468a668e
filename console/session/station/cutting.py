"""Arm, start, hold and retract: one cut of one part, as the operator asks for it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from importlib.metadata import version

from console.session.cut.alignment import problems
from console.session.cut.compensated import compensation_problems, path_of, stored_problems
from console.session.cut.interlocks import (
    Interlock,
    at_speed,
    of_job,
    of_lobe,
    of_machine,
    of_program,
    of_zero,
    refuse_unless,
)
from console.session.cut.planned_cut import PlannedCut, refuse_unless_held
from console.session.cut.sequence import EXTRA_TIME_S, TIME_ALLOWANCE, not_retracted, tool_clear
from console.session.data.calibrated_chuck import calibrations_of
from console.session.data.learned_store import NONE
from console.session.data.made_parts import AS_FILED, MODEL, MadeWith
from console.session.data.records import RunRecord
from console.session.errors import SessionError
from console.session.stages import Stage, air_mm
from console.session.station.blank import touched_by
from console.session.station.intents import Arm, Disarm, Retract, Start
from console.session.station.jogging import no_retract
from console.session.station.progress import CutStage, CutWatch
from console.session.station.state import Activity, Armed
from console.session.station.workplace import Workplace
from drivers.cutting.planning import CutPlan, first_spindle_counts, plan_cut
from drivers.errors import DriverError
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import way_problems
from profiles.job import Job
from profiles.problem import Problem, ProblemError

START_WITHIN_S = 10.0
"""How long after arming a cut may be started."""

AT_START = "at_start"


def arm(place: Workplace, order: Arm, job: Job) -> None:
    """Judge everything, load the program and read it back. Nothing moves; start is allowed for some seconds.

    `job` is that of the order with jaw 1 where it was found.

    Raises:
        SessionError: every reason why this cut may not start.
    """
    place.tell(armed=None)
    put_back(place)
    refuse_unless(Interlock(name="aligned", problems=problems(place.state.alignment, order.job)))
    machine = place.machine
    zero = of_zero(machine, order.strategy, jaw_found=True)
    as_found = of_lobe(job, machine, order.strategy, simulated=place.state.simulated)
    refuse_unless(of_job(job, machine), as_found, zero, _learned(place, order), _commissioned(place))
    turn, lease = _nearest_turn(place, job, order), place.lathe.lease
    plan = _planned(place, order, job, turn, lease)
    refuse_unless(of_program(plan))
    _refuse_tables(place)
    place.to_restore = plan.restore
    place.lathe.load(plan.program, plan.axis_definitions)
    _refuse_unless_ready(place, plan, starting=False)
    armed = Armed(
        job=job,
        strategy=order.strategy,
        plan=plan,
        alignment=place.state.alignment,
        until_s=place.clock.now_s() + START_WITHIN_S,
        made=_made_with(place, order),
        loaded=order.loaded,
    )
    _open_record(place, order, armed)
    place.plan = plan
    place.tell(armed=replace(armed, until_s=place.clock.now_s() + START_WITHIN_S))


def _learned(place: Workplace, order: Arm) -> Interlock:
    """Judge what was learned once more: it may have been chosen some time ago, and files may have changed."""
    learned = order.compensation
    problems = compensation_problems(
        learned,
        order.loaded if order.loaded is not None and order.loaded.job == order.job else None,
        place.loaded_machine,
        order.strategy,
        Stage(order.stage),
        simulated=place.shop is not None,
    )
    if learned is not None:
        problems += stored_problems(learned, place.records)
    return Interlock(name="learned_holds", problems=problems)


def _planned(place: Workplace, order: Arm, job: Job, turn: int, lease: str) -> CutPlan:
    """Plan the cut; nothing has been sent, so whatever stands against it is a refusal.

    Raises:
        SessionError: the problems of `path_of` and `plan_cut`.
    """
    stage, machine = Stage(order.stage), place.machine
    try:
        path = path_of(job, order.job, machine, order.strategy, stage, order.compensation)
        out_mm = air_mm(job, stage)
        return plan_cut(job, machine, order.strategy, from_turn=turn, lease=lease, path=path, air_mm=out_mm)
    except ProblemError as refused:
        raise SessionError(*refused.problems) from refused


def _made_with(place: Workplace, order: Arm) -> MadeWith:
    jaw, learned = place.state.alignment.jaw, order.compensation
    return MadeWith(
        compensation=NONE if learned is None else str(learned.version),
        strategy=order.strategy.value,
        stage=Stage(order.stage).value,
        inverted=MODEL,
        cut_jaw_1_deg=AS_FILED if jaw is None else str(jaw.angle_deg),
    )


def disarm(place: Workplace, _: Disarm) -> None:
    """Take it back, and what arming has changed on the card."""
    place.tell(armed=None)
    put_back(place)


def put_back(place: Workplace) -> None:
    """Make the card what its profile says, where a cut has changed it: after its end, and however it ended.

    Raises:
        DriverError: something moves, the link broke, or the controller refused a line.
    """
    if place.to_restore:
        place.lathe.restore(place.to_restore)
        place.to_restore = ()


def start(place: Workplace, _: Start) -> None:
    """Go to the start, tool last, look once more at everything, and cut.

    Raises:
        SessionError: not armed, or what the last look showed.
        DriverError: what ended the cut, or by what it is not the one that was planned.
        StoppedError: somebody stopped the machine.
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
    _refuse_changed(place, armed.plan)
    in_air = armed.made.stage == Stage.AIR
    plan, watch = armed.plan, CutWatch(armed.plan, armed.job, place.machine, in_air=in_air)
    planned = PlannedCut(place.lathe, plan)
    place.seen = partial(_publish, place, watch, CutStage.POSITION)
    try:
        _go_to_start(place, plan)
        _refuse_unless_ready(place, plan, starting=True)
        refuse_unless(at_speed(place.lathe, armed.job))
        refuse_unless_held(place.lathe, plan)
        place.note("started", strategy=armed.strategy.value)
        place.seen = partial(_publish, place, watch, CutStage.RUN_UP)
        place.tell(activity=Activity.CUTTING)
        place.lathe.start(plan.program.number, plan.setup.retracted)
        timeout_s = plan.duration_s * TIME_ALLOWANCE + EXTRA_TIME_S
        last = place.lathe.follow(partial(_between_polls, place, planned), timeout_s, planned.guard)
    finally:
        place.seen = None
    put_back(place)
    _refuse_another_cut(place, planned)
    _refuse_tables(place)
    _finish(place, watch, plan, last)


def retract(place: Workplace, _: Retract) -> None:
    """Take the tool out to where it is clear of the part, or by the retract distance where no part is known.

    A stop leaves the table of a cut on. Then the carriage goes back, too, to where that adds nothing, and there
    it is switched off.

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
    put_back(place)
    _leave_tables(place)


def _leave_tables(place: Workplace) -> None:
    if not place.lathe.tables_left():
        return
    plan = place.plan
    # Without a plan: the zero of the carriage is in front of every table.
    zero_z = 0.0 if plan is None or plan.zero_row_z is None else plan.zero_row_z
    place.lathe.jog_to(AxisName.CARRIAGE, zero_z, settle=False)
    refuse_unless(Interlock(name="no_table", problems=place.lathe.switch_tables_off()))


def _nearest_turn(place: Workplace, job: Job, order: Arm) -> int:
    """Return the whole turn nearest to where the spindle stands: each cut leaves it some hundreds further on."""
    start = first_spindle_counts(job, place.machine, order.strategy)
    return round((place.lathe.snapshot().spindle.position - start) / place.machine.spindle.counts_per_rev)


def _go_to_start(place: Workplace, plan: CutPlan) -> None:
    """Tool out first, in again last: beside the part."""
    lathe = place.lathe
    if lathe.snapshot().tool.position > plan.setup.retracted:
        lathe.retract(plan.setup.retracted)
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    if AxisName.SPINDLE in lathe.driven:
        lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    lathe.jog_to(AxisName.TOOL, plan.tool_start)


def _refuse_unless_ready(place: Workplace, plan: CutPlan, *, starting: bool) -> None:
    locks = of_machine(place.lathe.snapshot(), plan, place.lathe.machine, place.lathe.verify())
    refuse_unless(*(lock for lock in locks if starting or lock.name != AT_START))


def _commissioned(place: Workplace) -> Interlock:
    problems = () if place.commissioned is None else place.commissioned.problems(place.lathe.snapshot())
    return Interlock(name="commissioned", problems=problems)


def _refuse_tables(place: Workplace) -> None:
    """Refuse to go on while a compensation table adds something to the tool, or has left something behind."""
    refuse_unless(Interlock(name="no_table", problems=place.lathe.tables_left()))


def _refuse_changed(place: Workplace, plan: CutPlan) -> None:
    """Refuse to move at all where the machine is not as it was armed: its safety devices, settings, program."""
    devices, lathe = device_problems(place.lathe.snapshot().inputs), place.lathe
    refuse_unless(Interlock(name="safe", problems=(*devices, *way_problems(lathe.stop.way))))
    _refuse_unless_ready(place, plan, starting=False)
    refuse_unless_held(place.lathe, plan, tables=False)  # the table is read behind the way to the start


def _publish(place: Workplace, watch: CutWatch, stage: CutStage, snapshot: Snapshot) -> None:
    cut = watch.see(snapshot, stage, place.lathe.held, place.state.spindle_rpm)
    place.tell(cut=cut, touched=touched_by(cut, place.state.touched))


def _between_polls(place: Workplace, planned: PlannedCut, snapshot: Snapshot) -> None:
    """Between two polls of a cut: pass the operator's hold on, once."""
    planned.see(snapshot)
    if place.hold_asked and not place.lathe.held:
        place.lathe.hold()


def _refuse_another_cut(place: Workplace, planned: PlannedCut) -> None:
    """Refuse to call a cut done that is not the one that was planned: it is neither measured nor learned from.

    Raises:
        DriverError: by what it differs, and who has ended it where that is known.
    """
    problems = planned.problems()
    if problems:
        turns = None if planned.end is None else planned.end.turns
        place.note("ended_early", turns=turns, reasons=[problem.code for problem in problems])
        raise DriverError(*problems)


def _finish(place: Workplace, watch: CutWatch, plan: CutPlan, last: Snapshot) -> None:
    """The program has ended: say how, and prove that the tool is out."""
    held = place.lathe.held
    stage = CutStage.HELD if held else CutStage.DONE
    figures = watch.figures()
    ended = watch.see(last, stage, held, place.state.spindle_rpm)
    # What was cut in air has not met the part: it is as good a blank as before.
    done = not held and not ended.in_air
    place.tell(cut=ended if figures is None else ended.with_figures(figures), cut_done=done)
    made = {} if place.started is None else place.started.made.event()
    place.note("held" if held else "cut", turn=ended.turn, tool_error_peak_um=ended.tool_error_peak_um, **made)
    if not last.at_rest or not tool_clear(last, plan):
        raise SessionError(not_retracted(last, plan, place.lathe.machine))


def _open_record(place: Workplace, order: Arm, armed: Armed) -> None:
    place.end_record()
    machine = place.loaded_machine
    place.record = RunRecord(
        place.records,
        {
            "software": f"trilobe {version('trilobe')}",
            "job": order.job.name,
            "job_sha256": order.job_sha256,
            "machine": machine.machine.name,
            "machine_sha256": machine.sha256,
            "simulated": int(place.shop is not None),
            "strategy": order.strategy.value,
            "program": armed.plan.text,
        },
    )
    used = calibrations_of(machine)
    force_n, made = order.job.chucking_force_n, armed.made.event()
    place.note("armed", force_n=force_n, jaw_1_deg=_jaw_deg(place), calibrations=used, **made)


def _jaw_deg(place: Workplace) -> float | None:
    jaw = place.state.alignment.jaw
    return None if jaw is None else jaw.angle_deg
