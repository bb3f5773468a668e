"""Arm, start, hold and retract: one cut of one part, on the operator's commands."""

from __future__ import annotations

from dataclasses import replace

from console.session.cut.alignment import aligned_job, problems
from console.session.cut.compensated_cut import compensation_problems, inverted_path, path_of, stored_problems
from console.session.cut.engine import CutEnd, NotAsPlannedError, PartStep, cut, load
from console.session.cut.force_watch import ForceWatch
from console.session.cut.retracting import (
    CARRIAGE_ZERO_COUNTS,
    clear_tables,
    retract_and_switch_tables_off,
    retracted_by_distance,
)
from console.session.cut.run import plan_stage, refuse_unplannable
from console.session.cut.simulated_parts import LatheParts, lathe_setup
from console.session.cut.telemetry import expected_lag
from console.session.data.calibrated_chuck import calibrations_of
from console.session.data.identified_responses import changed_problems
from console.session.data.learned_store import NONE, asked_for, versions
from console.session.data.measured_part import AS_FILED, MODEL, MadeWith, newest_part, tool_event
from console.session.data.records import RunFacts, begin_record
from console.session.data.run_rows import problem_events
from console.session.errors import SessionError, refuse
from console.session.force_record import ForceCheck, force_event
from console.session.learning.fingerprint import FingerprintedCut, fingerprint_cut, refuse_unusable
from console.session.learning.learning_steps import check_of
from console.session.stages import Stage
from console.session.station.adjustment import find_bound_problem, step_value
from console.session.station.commands import Adjust, Arm, ClearTables, Disarm, HoldFeed, Retract, Start
from console.session.station.context import StationContext
from console.session.station.gain_trial import trial_problems
from console.session.station.jogging import no_retract
from console.session.station.progress import CutProgress, CutStage, CutTracker
from console.session.station.state import Activity, ArmedCut, TouchedBlank
from drivers.clock import boot_s
from drivers.cutting.bounds import REAL_TIME, UNTRIMMED, Adjustable, Bounds, CutAdjustment, CutChange, Trim
from drivers.cutting.cut_program import CutProgram
from drivers.cutting.feed_hold import HoldState
from drivers.cutting.override import bounds_of
from drivers.cutting.planning import CutPlan, first_spindle_counts
from drivers.cutting.tables import SWITCH
from drivers.errors import RefusedError
from drivers.identification.nominal import path_response
from drivers.lathe.snapshot import Snapshot
from profiles.axis.response import ServoResponse
from profiles.compensations.force_null import ForceNull
from profiles.compensations.learned_compensation import history_of
from profiles.compensations.path import CutPath
from profiles.fingerprint.readings import readings_text
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, job_text


def open_record(context: StationContext, command: Arm, plan: CutPlan, made: MadeWith) -> None:
    """Open the record of the cut that has been armed, and end the one before."""
    context.end_record()
    job, machine, jaw = command.job, context.loaded_machine, context.state.alignment.jaw
    touched, simulated = context.state.alignment.touch_off, context.cut_context.simulated
    facts = _facts(context, command)
    now_s = context.clock.now_s if simulated else boot_s  # a suspended computer stops no real machine
    context.open_record(begin_record(context.records, facts, machine, plan, simulated=simulated, now_s=now_s))
    context.log_command(command)
    context.note(
        "armed",
        force_n=job.chucking_force_n,
        jaw_1_deg=None if jaw is None else jaw.angle_deg,
        zero_radius_mm=None if touched is None else touched.zero_radius_mm,
        calibrations=calibrations_of(machine),
        **made.event(),
    )


def _lathe(context: StationContext) -> dict[str, object]:
    """Return which simulated lathe it is, and which part of it is in the chuck where they differ."""
    shop = context.shop
    if shop is None:
        return {}
    parts = LatheParts(lathe=shop.which, part=shop.parts) if shop.parts_differ else None
    return lathe_setup(shop.which, parts)


def _facts(context: StationContext, command: Arm) -> RunFacts:
    """Return what the run rests on: the job as it is cut, and the alignment, with the times of its stamps."""
    job, loaded, alignment = command.job, command.loaded, context.state.alignment
    clamping, jaw, touched = alignment.clamping, alignment.jaw, alignment.touch_off
    learned = command.compensation
    return RunFacts(
        job=job,
        job_sha256=command.job_sha256,
        job_text=loaded.text if loaded is not None and loaded.job == job and loaded.text else job_text(job),
        stage=Stage(command.stage).value,
        compensation=None if learned is None else learned.version,
        controller=context.state.controller or None,
        job_path=None if loaded is None else loaded.path,
        setup={
            "force_n": job.chucking_force_n,
            "clamped_at": None if clamping is None else clamping.at,
            "jaw_1_deg": None if jaw is None else jaw.angle_deg,
            "jaw_1_at": None if jaw is None else jaw.at,
            "zero_radius_mm": None if touched is None else touched.zero_radius_mm,
            "touch_off_at": None if touched is None else touched.at,
            "aligned": True,
            "calibrations": calibrations_of(context.loaded_machine),
            "inverted": MODEL if command.inverts is None else command.inverts.name,
            "indicated": None if alignment.readings is None else readings_text(alignment.readings),
            "address": context.state.address,
            **_lathe(context),
        },
    )


class CutChanges:
    """The changes of one cut. `changed_mm` is where the first was made, mm behind the face; None without any."""

    def __init__(self, context: StationContext, bounds: Bounds) -> None:
        self.changed_mm: float | None = None
        self._context, self._bounds = context, bounds
        self._last = CutAdjustment(bounds=bounds)
        self._applied = UNTRIMMED
        self._told: Problem | None = None

    @property
    def adjustment(self) -> CutAdjustment:
        """What was commanded, and the trim that the controller reports."""
        program = self._context.lathe.program
        return CutAdjustment(
            override_percent=program.override.commanded,
            trim=program.live_trim.asked,
            applied=program.live_trim.applied,
            bounds=self._bounds,
        )

    def pass_on(self) -> None:
        """Pass on what the operator has asked for, in the order of the presses, and note what was applied.

        Raises SessionError: `record.lost`. StoppedError, LinkError: as any command of a cut.
        """
        context = self._context
        while context.adjust_asked:
            self._pass_on(context.adjust_asked.popleft())
        self._note_applied(context.lathe.program)

    def _pass_on(self, asked: Adjust) -> None:
        context, program = self._context, self._context.lathe.program
        value = step_value(asked, self.adjustment.value_of(asked.what))
        refused = find_bound_problem(asked.what, value, self._bounds)
        if refused is not None:  # several presses between two polls
            self._refuse((refused,))
            return
        cut = context.state.cut
        z_mm = 0.0 if cut is None else cut.z_mm
        try:
            if asked.what is Adjustable.OVERRIDE:
                program.override.command(round(value))
            else:
                program.live_trim.ask(_set_trim_value(program.live_trim.asked, asked.what, value))
        except RefusedError as error:  # another console controls the machine: nothing was sent
            self._refuse(tuple(error.problems))
            return
        if self.changed_mm is None:
            self.changed_mm = z_mm
        self._last = self.adjustment
        context.note("adjusted", what=asked.what.value, value=value, z_mm=z_mm)

    def _refuse(self, problems: tuple[Problem, ...]) -> None:
        self._context.log_refusal(problems)
        self._context.tell(refusals=problems)

    def _note_applied(self, program: CutProgram) -> None:
        trim = program.live_trim
        if trim.applied == trim.asked != self._applied:
            self._applied = trim.applied
            cut = self._context.state.cut
            z_mm = 0.0 if cut is None else cut.z_mm
            self._context.note(
                "trimmed", gain_percent=trim.applied.gain_percent, phase_deg=trim.applied.phase_deg, z_mm=z_mm
            )
        if trim.problem is not None and trim.problem != self._told:
            self._refuse((trim.problem,))
        self._told = trim.problem

    def describe_making(self, made: MadeWith) -> MadeWith:
        """Return how the part was made, with what was changed while it was cut."""
        changed = self.cut_change
        return made if changed is None else replace(made, changed=_words(changed))

    @property
    def cut_change(self) -> CutChange | None:
        """What was changed by now; None if nothing was."""
        if self.changed_mm is None:
            return None
        return CutChange(
            override_percent=self._last.override_percent, trim=self._last.trim, from_mm=self.changed_mm
        )


def _set_trim_value(trim: Trim, what: Adjustable, value: float) -> Trim:
    if what is Adjustable.GAIN:
        return replace(trim, gain_percent=value)
    return replace(trim, phase_deg=value)


def _words(changed: CutChange) -> str:
    """Return the last values in the notation of the record, and from where on something was changed."""
    trim = changed.trim
    last = f"override {changed.override_percent} %, gain {trim.gain_percent:+g} %, phase {trim.phase_deg:+g} deg"
    return f"{last}, changed from Z {changed.from_mm:.1f} mm on"


def left_behind(context: StationContext) -> float | None:
    """Take over an override that was left on the controller, as by a lost link; return it, None for real time.

    A controller that is held (0 %) is not ours to release.
    """
    snapshot = context.state.snapshot
    if snapshot is None or not snapshot.at_rest or snapshot.override_percent < 1.0:
        return None
    percent = snapshot.override_percent
    if abs(percent - REAL_TIME) <= 0.5:
        return None
    context.lathe.program.override.commanded = round(percent)
    return percent


def arm(context: StationContext, command: Arm) -> None:
    """Check everything, load the program and read it back. Nothing moves; start is allowed for some seconds."""
    context.tell(armed=None)
    percent = left_behind(context)
    context.lathe.program.put_back()
    refuse(trial_problems(context))
    alignment, own, strategy = context.state.alignment, context.cut_context, command.strategy
    job = aligned_job(command.job, alignment)
    refuse(problems(alignment, command.job))
    also = _check_learned_version(context, command), own.commissioned(own.lathe.snapshot())
    refuse_unplannable(job, context.machine, strategy, *also, jaw_found=True, simulated=own.simulated)
    plan, fingerprint = _plan_armed_cut(context, command, job)
    loading_s = 2.0 * len(plan.program.lines) * context.lathe.round_trip_s  # twice a poll for each line
    context.tell(loading_until_s=context.clock.now_s() + loading_s)
    try:
        load(own, plan, lambda *_: None, aligned=True)
    finally:
        context.tell(loading_until_s=None)
    made = _describe_making(context, command, fingerprint)
    taught_by = None if command.compensation is None else command.compensation.part
    open_record(context, command, plan, made)
    context.plan = plan
    context.expected_lag = expected_lag(plan.target, job, taught_by, Stage(command.stage).fraction)
    armed = ArmedCut(
        job=job,
        strategy=strategy,
        plan=plan,
        alignment=context.state.alignment,
        until_s=context.clock.now_s() + command.valid_s,
        made=made,
        loaded=command.loaded,
        bounds=bounds_of(plan, job, context.machine, _response(command, context.machine)),
        warnings=() if fingerprint is None else fingerprint.clamped.warnings,
    )
    if percent is not None:
        context.note("override_restored", percent=percent)
    context.tell(armed=armed, force=_checked_before(context, job, command.loaded))


def _describe_making(context: StationContext, command: Arm, fingerprint: FingerprintedCut | None) -> MadeWith:
    """Return how the part will have been cut."""
    jaw, learned = context.state.alignment.jaw, command.compensation
    return MadeWith(
        compensation=NONE if learned is None else str(learned.version),
        strategy=command.strategy.value,
        stage=Stage(command.stage).value,
        inverted=MODEL if command.inverts is None else command.inverts.name,
        cut_jaw_1_deg=AS_FILED if jaw is None else str(jaw.angle_deg),
        fingerprint="" if fingerprint is None else fingerprint.made,
    )


def _checked_before(context: StationContext, job: Job, loaded: LoadedJob | None) -> ForceCheck | None:
    """Return what the force said of this job last; by the record, where this console has not cut it."""
    known = context.state.force
    if known is not None and known.concerns(job):
        return known
    if loaded is None:
        return None
    asked = asked_for(loaded, context.loaded_machine, "", simulated=context.shop is not None)
    try:
        return check_of(newest_part(context.records, asked), loaded.job)
    except ProblemError:
        return None  # whoever needs the record reports what is wrong with it


def _response(command: Arm, machine: MachineProfile) -> ServoResponse:
    """Return the response that the cut inverts: the chosen one, else the model of its path."""
    if command.inverts is not None:
        return command.inverts.response
    return path_response(command.strategy, machine)


def _check_learned_version(context: StationContext, command: Arm) -> tuple[Problem, ...]:
    """Check version and response again: they may have been chosen some time ago, and files may have changed."""
    learned, loaded = command.compensation, command.loaded
    problems = compensation_problems(
        learned,
        loaded if loaded is not None and loaded.job == command.job else None,
        context.loaded_machine,
        command.strategy,
        Stage(command.stage),
        simulated=context.shop is not None,
        lathe=context.state.lathe,
        inverts=command.inverts,
    )
    if command.inverts is not None:
        problems = (*problems, *changed_problems(command.inverts))
    return problems if learned is None else (*problems, *stored_problems(learned, context.records))


def _plan_armed_cut(context: StationContext, command: Arm, job: Job) -> tuple[CutPlan, FingerprintedCut | None]:
    """Plan the cut, by the fingerprint of the clamping where one was taken, and return that.

    Nothing has been sent, so every objection is a refusal.
    """
    strategy, machine, stage = command.strategy, context.machine, Stage(command.stage)
    path = path_of(job, command.job, command.compensation)
    # From the whole turn nearest to the spindle position: each cut leaves it some hundreds further on.
    start = first_spindle_counts(job, machine, strategy)
    turn = round((context.lathe.snapshot().spindle.position - start) / machine.spindle.counts_per_rev)
    watchdog = context.lathe.program.watchdog
    try:
        if path is None:
            path = inverted_path(job, machine, strategy, command.inverts)
        found = _fingerprint_clamping(context, command, job, path)
        path = path if found is None else found.path
        return plan_stage(job, machine, strategy, stage, path, watchdog=watchdog, from_turn=turn), found
    except ProblemError as refused:
        raise SessionError(*refused.problems) from refused


def _fingerprint_clamping(
    context: StationContext, command: Arm, job: Job, path: CutPath | None
) -> FingerprintedCut | None:
    """Return the fingerprint of this clamping with its path, None if none was taken."""
    readings, learned, strategy = context.state.alignment.readings, command.compensation, command.strategy
    if readings is None or not strategy.traits.inverts or Stage(command.stage) is Stage.AIR:
        return None
    refuse_unusable(strategy, Stage(command.stage), readings, simulated=context.shop is not None)
    known = () if learned is None else versions(context.records, learned.holds_for)
    inverted = None if command.inverts is None else command.inverts.response
    return fingerprint_cut(
        readings,
        job,
        command.job,
        context.machine,
        strategy,
        path=path,
        history=history_of(learned, known),
        inverted=inverted,
    )


def disarm(context: StationContext, _: Disarm) -> None:
    """Disarm, and undo what arming has changed on the controller."""
    context.tell(armed=None)
    context.lathe.program.put_back()


def start(context: StationContext, _: Start) -> None:
    """Run the armed cut; refused where nothing is armed, else as `cut`."""
    armed = context.state.armed
    if armed is not None and context.clock.now_s() > armed.until_s:
        armed = None
    if armed is not None:
        refuse(problems(context.state.alignment, armed.job))
    if armed is None or context.state.alignment != armed.alignment:
        context.tell(armed=None)
        raise SessionError(Problem(code="session.not_armed"))
    context.started = armed
    context.tell(armed=None, cut=None, cut_done=False, measured=None, form=None)
    watched = _CutPublisher(context, armed)
    context.seen = watched.publish
    before = context.state.cut_to
    touched_mm = 0.0 if before is None else before.to_mm
    try:
        end = cut(context.cut_context, armed.job, armed.plan, watched.step, watched.see, touched_mm=touched_mm)
        force = watched.force.result() if watched.force else None
    except NotAsPlannedError as early:
        why = problem_events(early.problems)
        context.note("ended_early", turns=early.turns, **why, cut_verdict=early.judgement)
        raise
    finally:
        context.seen = None
    _finish(context, watched, end, force)


class _CutPublisher:
    """Publish a cut to the screens, and pass what the operator asks for to the program."""

    def __init__(self, context: StationContext, armed: ArmedCut) -> None:
        self._context, self._strategy, self._stage = context, armed.strategy, CutStage.POSITION
        in_air, lag = armed.made.stage == Stage.AIR, context.expected_lag
        self.watch = CutTracker(armed.plan, armed.job, context.machine, in_air=in_air, expected_lag=lag)
        self._reports = context.lathe.program.reports()
        self._held = False
        half, self._plan = armed.made.stage == Stage.PARTIAL, armed.plan
        self.force = ForceWatch(context.lathe, armed.job) if half else None
        self.adjusting = CutChanges(context, armed.bounds)

    def step(self, step: PartStep, detail: str) -> None:
        if step is PartStep.CUT:
            if self.force is not None:
                self.force.begin(self._plan)
            self._context.note("started", strategy=self._strategy.value)
            self._stage = CutStage.RUN_UP
            self._context.tell(activity=Activity.CUTTING)

    def see(self, snapshot: Snapshot) -> None:
        """Pass the operator's hold on, once, between two polls of the program, and read what it reports."""
        context = self._context
        if self._reports is not None and self._phase_is_known():
            self._reports.read()
        if self.force is not None:
            self.force.see(snapshot)
        if context.end_asked and not context.lathe.program.held:
            context.lathe.program.end_after_turn()
        self._pass_on_hold()
        self.adjusting.pass_on()

    def _phase_is_known(self) -> bool:
        """Whether there is time for a report: the first polls in the part tell whether the tool is in phase."""
        cut = self._context.state.cut
        if cut is None or cut.stage in (CutStage.POSITION, CutStage.RUN_UP):
            return False
        return cut.stage is not CutStage.CUT or cut.phase is not None or not cut.judged

    def _pass_on_hold(self) -> None:
        """Pass on what the operator has asked of a feed hold, and note what the program reports of it."""
        context, hold = self._context, self._context.lathe.program.hold
        asked, context.hold_asked = context.hold_asked, None
        try:
            if isinstance(asked, HoldFeed):
                hold.ask()
            elif asked is not None:
                hold.resume(one_turn=asked.one_turn)
        except RefusedError as refused:  # it has ended meanwhile, or a line did not arrive: nothing was sent
            context.log_refusal(refused.problems)
            context.tell(refusals=tuple(refused.problems))
        held, cut = hold.report.state is HoldState.HELD, context.state.cut
        if held is not self._held and cut is not None:
            self._held = held
            context.note("feed_hold" if held else "resumed", turn=cut.turn, z_mm=cut.z_mm, turns=hold.report.turns)

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a status poll, in whatever wait it was made; after a reset its positions mean nothing."""
        context = self._context
        if not snapshot.homed:
            return
        program = context.lathe.program
        speed_rpm, adjusted = context.state.spindle_rpm, self.adjusting.adjustment
        seen = self.watch.see(snapshot, self._stage, program.held, speed_rpm, program.hold.report, adjusted)
        if self._reports is not None:
            seen = replace(seen, place=self._reports.place)
        context.tell(cut=seen, touched=_update_touched_blank(seen, context.state.touched))


def _update_touched_blank(cut: CutProgress, before: TouchedBlank | None) -> TouchedBlank | None:
    """Return how far the blank is cut after a moment of a cut; an interrupted cut leaves it a blank no longer."""
    if cut.stage is not CutStage.CUT or cut.in_air or (before is not None and before.to_mm >= cut.z_mm):
        return before
    return TouchedBlank(to_mm=cut.z_mm, of_mm=cut.length_mm)


def retract(context: StationContext, _: Retract) -> None:
    """Retract the tool until it is clear of the part, or by the retract distance where no part is known.

    A stop leaves the compensation table of a cut on. Then the carriage moves back, too, to where the table adds
    nothing, and the table is switched off there; a tool that is out already stays where it is. Without a home the
    path of a cut is nowhere: the tool goes out by the retract distance from where it stands.

    Raises:
        SessionError: `screen.tool_is_out`, and no table is known to be on.
    """
    snapshot = context.lathe.snapshot()
    refused = no_retract(snapshot, context.loaded_machine.machine, context.state.alignment)
    if refused is not None:
        raise SessionError(refused)
    plan, alignment = context.plan, context.state.alignment
    if plan is None or not snapshot.homed:
        retract_and_switch_tables_off(context.lathe, retracted_by_distance(context.machine, snapshot))
    elif not alignment.tables and snapshot.tool.position < plan.setup.retracted:
        raise SessionError(Problem(code="screen.tool_is_out"))
    else:
        zero_z = CARRIAGE_ZERO_COUNTS if plan.zero_row_z is None else plan.zero_row_z
        out = min(plan.setup.retracted, snapshot.tool.position) if alignment.tables else plan.setup.retracted
        retract_and_switch_tables_off(context.lathe, out, zero_z)
    if alignment.tables:
        _tables_are_off(context)


def clear_left_tables(context: StationContext, _: ClearTables) -> None:
    """Clear tables that were left on, where no home is known: with the drives killed, so that nothing moves.

    Jaw 1 and the touch-off mean nothing afterwards, and the axes have to be homed.

    Raises:
        DriverError: as `CutProgram.clear_tables`, nothing was sent.
    """
    clear_tables(context.lathe, context.clock)
    _tables_are_off(context)
    alignment = context.state.alignment
    context.tell(alignment=replace(alignment, jaw=None, touch_off=None, flanks=(), skim_counts=None))


def _tables_are_off(context: StationContext) -> None:
    """Report that no table adds anything; that this console has switched them off is no deed of another."""
    if context.commissioned is not None:
        context.commissioned.wrote({int(SWITCH[1:]): 0.0})
    context.tell(alignment=replace(context.state.alignment, tables=()))


def _finish(context: StationContext, watched: _CutPublisher, end: CutEnd, force: ForceNull | None) -> None:
    """Report how the cut has ended, and what its force says of a half stage."""
    stage = CutStage.HELD if end.held else CutStage.DONE
    adjusted = watched.adjusting.adjustment
    ended = watched.watch.see(end.last, stage, end.held, context.state.spindle_rpm, adjusted=adjusted)
    if context.started is not None:
        context.started = replace(context.started, made=watched.adjusting.describe_making(context.started.made))
    if ended.holds_mm:
        context.note("held_at", z_mm=list(ended.holds_mm))
    # An air cut has not touched the part: it is as good a blank as before.
    ended = replace(ended, figures=end.figures, changed=watched.adjusting.cut_change, force=force)
    if force is not None and context.started is not None:
        context.tell(force=ForceCheck(job=context.started.job, found=force))
    done = not end.held and not ended.in_air
    context.parts += done
    context.tell(cut=ended, cut_done=done)
    made = {} if context.started is None else context.started.made.event()
    if end.figures is not None:
        made |= tool_event(end.figures.tool_lobe_um, end.figures.push_um) | end.figures.event()
    made |= force_event(force)
    context.note(
        "held" if end.held else "cut", turn=ended.turn, tool_error_peak_um=ended.tool_error_peak_um, **made
    )
