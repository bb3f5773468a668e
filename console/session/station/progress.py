"""Progress of the cut: one immutable value per status poll, with speed and synchronisation."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from enum import StrEnum
from statistics import linear_regression

import numpy as np
from numpy.typing import NDArray

from console.session.cut import telemetry
from console.session.cut.interlocks import SPEED_BAND
from console.session.cut.telemetry import NO_LAG, Lag
from drivers.cutting.bounds import AS_PLANNED, REAL_TIME, CutAdjustment, CutChange
from drivers.cutting.feed_hold import MOST_HELD_S, NOT_HELD, HoldReport, HoldState
from drivers.cutting.live_trim import trim_um
from drivers.cutting.planning import CutPlan
from drivers.cutting.program_reports import ProgramPlace
from drivers.cutting.strategy import Strategy
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from profiles.compensations.force_null import ForceNull
from profiles.job import Job
from profiles.machine import MachineProfile

AVERAGED_S = 1.0  # averaging time of the speed: the time of a single poll is known to some ms only
KEPT_POLLS = 240  # polls that are shown and judged: some eight seconds
PHASE_POLLS = 60

BEGUN_UM = 20.0  # a tool this far from its position at program start was moved by the program
STANDS_FRACTION = 0.05  # below this fraction of the job's speed a spindle counts as stopped
ARRIVED_COUNTS = 20.0  # an axis this near to its target has arrived
AXIS_S = 0.4  # ramps and settling of one jog, beside its way at jog speed


class CutStage(StrEnum):
    """The stages of a cut in their order. While it is `paused` by a feed hold the tool is out; then it cuts on."""

    POSITION = "position"
    RUN_UP = "run_up"
    CUT = "cut"
    PAUSED = "paused"
    RETRACT = "retract"
    DONE = "done"
    HELD = "held"


RUNNING = frozenset({CutStage.RUN_UP, CutStage.CUT, CutStage.PAUSED, CutStage.RETRACT})
"""Stages in which the program of a cut runs."""


class CutPhase(StrEnum):
    """The phases from F6 to rest: the axes go to the start, the spindle runs up, and so on.

    `index` is the wait for the index of a spindle that is the clock of the program; `home` runs the spindle down
    and takes the carriage back where the program does so.
    """

    APPROACH = "approach"
    RUN_UP = "run_up"
    INDEX = "index"
    CUT = "cut"
    RETRACT = "retract"
    HOME = "home"


@dataclass(frozen=True, slots=True)
class PhaseLeft:
    """A phase that is not over, and the seconds that it still takes."""

    phase: CutPhase
    left_s: float


@dataclass(frozen=True, slots=True)
class AxisToGo:
    """The way that an axis still has to go: mm, for the spindle degrees."""

    axis: AxisName
    left: float


def planned_phases(plan: CutPlan, machine: MachineProfile) -> tuple[PhaseLeft, ...]:
    """Return every phase of the program of a cut with its planned time; the approach is not in the program."""
    setup, checked = plan.setup, plan.checked
    carriage, tool = (checked.motors.index(motor) for motor in (machine.carriage.motor, machine.tool.motor))
    turn_s = 60.0 / plan.spindle_speed_rpm
    cut_s = (setup.whole_turns - setup.turns_clear) * turn_s
    now_s, begun_s, out_s = 0.0, None, None
    for move in checked.moves:
        now_s += sum(piece.duration_ms for piece in move.pieces) / 1000.0
        at = move.record.target
        if begun_s is None and at[carriage] >= setup.carriage_face:
            begun_s = now_s
        if begun_s is not None and out_s is None and now_s > begun_s + cut_s - turn_s:
            out_s = now_s if at[tool] <= setup.retracted + ARRIVED_COUNTS else None
    begun_s = 0.0 if begun_s is None else begun_s
    out_s = begun_s + cut_s if out_s is None else out_s
    index = (PhaseLeft(CutPhase.INDEX, turn_s),) if plan.strategy.traits.spindle_time else ()
    return (
        PhaseLeft(CutPhase.RUN_UP, begun_s),
        *index,
        PhaseLeft(CutPhase.CUT, cut_s),
        PhaseLeft(CutPhase.RETRACT, max(out_s - begun_s - cut_s, 0.0)),
        PhaseLeft(CutPhase.HOME, max(plan.duration_s - out_s, 0.0)),
    )


def to_the_start(plan: CutPlan, machine: MachineProfile, snapshot: Snapshot) -> tuple[AxisToGo, ...]:
    """Return how far each axis still is from where the program begins; those that have arrived are left out."""
    targets = {
        AxisName.CARRIAGE: plan.carriage_start,
        AxisName.SPINDLE: plan.spindle_start,
        AxisName.TOOL: plan.tool_start,
    }
    per_unit = {
        AxisName.CARRIAGE: machine.carriage.counts_per_mm,
        AxisName.SPINDLE: machine.spindle.counts_per_rev / 360.0,
        AxisName.TOOL: machine.tool.counts_per_mm,
    }
    return tuple(
        AxisToGo(axis, abs(counts) / per_unit[axis])
        for axis in targets
        if axis in driven_axes(machine)
        and abs(counts := targets[axis] - snapshot.axis(axis).position) > ARRIVED_COUNTS
    )


def approach_s(plan: CutPlan, machine: MachineProfile, snapshot: Snapshot) -> float:
    """Return about how long the axes still take to where the program begins, one after the other, s."""
    ways = to_the_start(plan, machine, snapshot)
    return sum(way.left / settings_of(machine, way.axis).jog_speed + AXIS_S for way in ways)


class CutPhaseClock:
    """Which phases of one cut are not over, with the time left: by the clock of the polls, the cut by its Z."""

    def __init__(self, plan: CutPlan, machine: MachineProfile) -> None:
        self._plan, self._machine = plan, machine
        self._planned = planned_phases(plan, machine)
        self._begun_s: dict[CutPhase, float] = {}

    def remaining_phases(
        self, phase: CutPhase, snapshot: Snapshot, cut_left_s: float, pace: float = 1.0
    ) -> tuple[PhaseLeft, ...]:
        """Return what is left from `phase` on; `cut_left_s` is that of the cut by the length already cut.

        In a second `pace` of the program's time passes.
        """
        if phase is CutPhase.APPROACH:
            first = PhaseLeft(phase, approach_s(self._plan, self._machine, snapshot))
            return first, *self._planned
        order = [each.phase for each in self._planned]
        begun_s = self._begun_s.setdefault(phase, snapshot.at_s)
        left: list[PhaseLeft] = []
        gone_s = snapshot.at_s - begun_s
        for each in self._planned[order.index(phase) :]:
            if each.phase is CutPhase.CUT:  # its time is that of its length
                left.append(PhaseLeft(each.phase, cut_left_s if phase is CutPhase.CUT else each.left_s))
                gone_s = 0.0
                continue
            # What a phase has taken beyond its time is taken from the next one.
            takes_s = each.left_s / pace
            spent_s = min(gone_s, takes_s)
            gone_s -= spent_s
            if takes_s > spent_s or each.phase is phase:
                left.append(PhaseLeft(each.phase, takes_s - spent_s))
        return tuple(left)


@dataclass(frozen=True, slots=True, kw_only=True)
class CutProgress:
    """One moment of a cut.

    `speed_rpm` is None until enough was sampled. Angles are degrees from the spindle index. `angles_deg` and
    `errors_um` (tool against the target path at the spindle angle of that instant, infeed positive) are the last
    samples in the part, oldest first, read-only. `phase` is the phase lag of the tool behind the target path, in
    spindle degrees, None until enough was sampled or without a lobe; `phase_limit_deg` is its limit by the part,
    None if no phase spoils it, about the `expected_lag` that learning counts on. `lag_deg` is the lag beyond
    that, behind the path as it is trimmed. `fraction` is that of the cut length. `figures` are those of the whole
    cut, once it has ended. `judged` is False if the strategy follows no lobe: the tool error is then the lobe
    itself, and there is no phase. `synchronisation` is None if nothing must be synchronised, or too little was
    sampled.
    `ripple` is the speed ripple of the spindle within a turn, by the last samples in the part; None if it
    cannot be determined. A cut `in_air` has all of it beside the part, at the planned clearance.

    `phases` are those that are not over, with the time left. `to_go` is how far the axes have to go: to the start
    of the program, in the cut the carriage to its end. `place` is the line of the program, by the controller; None
    where it has not reported one.

    `hold` is the feed hold, by the controller; it may be asked for from Z `hold_from_mm` on, None if the
    program cannot be held. `holds_mm` is where it was held, `held_left_s` how long the program still waits.
    `adjusted` is what was changed of the running cut. Times go with its override; error and phase are against the
    target of the job, so that they show what a trim does; `path_phase` is that against the trimmed path. `changed`
    is what was changed of a cut that has ended, None if nothing was; `force` what the force of one in the half
    stage says of sign and angle. `stretches` have the tool error along Z so far.
    """

    stage: CutStage
    holding: bool
    turn: float
    turns: float
    z_mm: float
    length_mm: float
    left_s: float
    speed_rpm: float | None
    tool_radius_mm: float
    infeed_um: float
    tool_error_um: float
    tool_error_peak_um: float
    following_error_um: float
    phase: telemetry.PhaseLag | None
    angles_deg: NDArray[np.float64]
    errors_um: NDArray[np.float64]
    phase_limit_deg: float | None
    figures: telemetry.CutFigures | None = None
    judged: bool = True
    synchronisation: Synchronisation | None = None
    ripple: telemetry.SpindleRipple | None = None
    in_air: bool = False
    phases: tuple[PhaseLeft, ...] = ()
    to_go: tuple[AxisToGo, ...] = ()
    place: ProgramPlace | None = None
    hold: HoldReport = NOT_HELD
    hold_from_mm: float | None = None
    holds_mm: tuple[float, ...] = ()
    held_left_s: float | None = None
    adjusted: CutAdjustment = AS_PLANNED
    path_phase: telemetry.PhaseLag | None = None
    expected_lag: Lag = NO_LAG
    changed: CutChange | None = None
    force: ForceNull | None = None
    stretches: tuple[telemetry.CutStretch, ...] = ()

    @property
    def in_phase(self) -> bool | None:
        """Whether the phase error is within its limit, beside a trim; None while it is not known."""
        return telemetry.is_in_phase(self.path_phase or self.phase, self.phase_limit_deg, self.expected_lag)

    @property
    def lag_deg(self) -> float | None:
        """Lag of the tool behind its path beyond the expected one, spindle degrees; None while it is not known."""
        phase = self.path_phase or self.phase
        return None if phase is None else telemetry.unexpected_deg(phase.error_deg, self.expected_lag)

    @property
    def is_lost(self) -> bool:
        """Whether the tool is in the part and out of synchronisation with the spindle."""
        return self.synchronisation is Synchronisation.LOST

    @property
    def fraction(self) -> float:
        """Fraction of the cut length that is done, 0 to 1."""
        return min(max(self.z_mm / self.length_mm, 0.0), 1.0)


class Synchronisation(StrEnum):
    """Synchronisation of tool and spindle.

    `queued`: the program runs, but the spindle is not at speed yet or the carriage not at the part. `waiting`: the
    program's time stands still until the index of the spindle. `in_sync`: in the part, in phase. `lost`: in
    the part, out of phase or with a stopped spindle.
    """

    QUEUED = "queued"
    WAITING = "waiting"
    IN_SYNC = "in_sync"
    LOST = "lost"


class SpindleWatch:
    """Follow the spindle through every status poll. It belongs to the link thread."""

    def __init__(self, counts_per_rev: float) -> None:
        self._counts_per_rev = counts_per_rev
        self._polls: list[tuple[float, float]] = []  # times in s, counts
        self._homed = False

    def see(self, snapshot: Snapshot) -> float | None:
        """Return the speed in rpm including this poll, None while there is only one."""
        homed = "home_complete" in snapshot.spindle.flags
        if homed != self._homed:
            self._homed = homed
            self.forget()  # the zero of the counts has moved, not the spindle
        self._polls = [poll for poll in self._polls if snapshot.at_s - AVERAGED_S <= poll[0] < snapshot.at_s]
        self._polls.append((snapshot.at_s, snapshot.spindle.position))
        if len(self._polls) < 2:
            return None
        times_s, counts = zip(*self._polls, strict=True)
        if counts.count(counts[0]) == len(counts):
            return 0.0  # the line through them is level
        turns = [each / self._counts_per_rev for each in counts]
        return 60.0 * linear_regression(times_s, turns).slope

    def forget(self) -> None:
        """Discard earlier polls: they belong to another motion."""
        self._polls = []


class FeedHoldTracker:
    """When a feed hold has the tool off its path, by the reports of the program: such polls are not judged.

    The program reports its moves before they are made, so a turn is left out after it has come back. `at_mm` is
    where the cut was held, `left_s` how long the program still waits.
    """

    def __init__(self, counts_per_rev: float) -> None:
        self.at_mm: tuple[float, ...] = ()
        self.left_s: float | None = None
        self._per_rev = counts_per_rev
        self._back_at: float | None = None
        self._held_s: float | None = None

    def see(self, snapshot: Snapshot, hold: HoldReport, reached_mm: float, pace: float) -> bool:
        """Take a poll, with how far the part is cut; return whether the tool may be off its path.

        The program waits by its own time, of which `pace` passes in a second.
        """
        if hold.state is HoldState.HELD:
            if self._held_s is None:
                self._held_s, self.at_mm = snapshot.at_s, (*self.at_mm, reached_mm)
            self.left_s = max(MOST_HELD_S / pace - (snapshot.at_s - self._held_s), 0.0)
        else:
            self._held_s = self.left_s = None
        if hold.active:
            self._back_at = abs(snapshot.spindle.position) + self._per_rev
        return self._back_at is not None and abs(snapshot.spindle.position) < self._back_at


class CutTracker:
    """Follow one cut. `see` is called with every status poll; it belongs to the link thread."""

    def __init__(
        self, plan: CutPlan, job: Job, machine: MachineProfile, *, in_air: bool = False, expected_lag: Lag = NO_LAG
    ) -> None:
        self._plan, self._job, self._machine, self._in_air = plan, job, machine, in_air
        self._end = plan.carriage_start + plan.setup.carriage_counts
        self._face = self._end - job.cut_length_mm * machine.carriage.counts_per_mm
        self._errors: deque[tuple[float, float]] = deque(maxlen=KEPT_POLLS)
        self._infeeds: deque[tuple[float, float]] = deque(maxlen=PHASE_POLLS)
        self._untrimmed: deque[tuple[float, float]] = deque(maxlen=PHASE_POLLS)  # as they would be without a trim
        self._turning: deque[tuple[float, float]] = deque(maxlen=KEPT_POLLS)
        self._peak_um = self._reached_mm = 0.0
        self._stretches = telemetry.planned_stretches(job)
        self._held = self._over = False
        self._judged = plan.strategy.traits.follows_lobe
        self._phase_limit_deg = telemetry.phase_limit_deg(plan.target, job.roundness_tolerance_um)
        # In air no force is on the tool: it may also follow its path as it is.
        self._expected_lag = (min(expected_lag[0], 0.0), max(expected_lag[1], 0.0)) if in_air else expected_lag
        self._clock = CutPhaseClock(plan, machine)
        self._away = FeedHoldTracker(machine.spindle.counts_per_rev)
        self._adjusted, self._pace = AS_PLANNED, 1.0

    def see(
        self,
        snapshot: Snapshot,
        stage: CutStage,
        holding: bool,
        speed_rpm: float | None,
        hold: HoldReport = NOT_HELD,
        adjusted: CutAdjustment = AS_PLANNED,
    ) -> CutProgress:
        """Take a poll and return the progress at that moment, including the spindle speed."""
        self._adjusted, self._pace = adjusted, adjusted.override_percent / REAL_TIME
        # A hold that is asked for in the last turn comes too late: the tool goes out as at the end of any cut.
        ends = hold.cut_turns >= self._plan.setup.whole_turns
        if ends or hold.state is HoldState.HELD:  # by its report: the turns of a hold for one turn are not polled
            fed_mm = (hold.cut_turns - self._plan.setup.turns_clear) * self._job.feed_mm_per_rev
            self._reached_mm = max(self._reached_mm, fed_mm)
        away = self._away.see(snapshot, hold, self._reached_mm, self._pace)
        if away and stage is CutStage.RUN_UP and not (holding or ends):
            stage = CutStage.PAUSED if hold.state is HoldState.HELD else CutStage.CUT
        moment, first = self._judged_moment(snapshot, stage, holding, speed_rpm), self._plan.hold_from
        return replace(
            moment,
            phases=self._phases(snapshot, moment),
            to_go=self._to_go(snapshot, moment),
            hold=hold,
            hold_from_mm=None if first is None else (first - self._face) / self._machine.carriage.counts_per_mm,
            holds_mm=self._away.at_mm,
            held_left_s=self._away.left_s if moment.stage is CutStage.PAUSED else None,
            adjusted=adjusted,
        )

    def _judged_moment(
        self, snapshot: Snapshot, stage: CutStage, holding: bool, speed_rpm: float | None
    ) -> CutProgress:
        angle_deg = 360.0 * snapshot.spindle.position / self._machine.spindle.counts_per_rev
        infeed_um = (snapshot.tool.position - self._plan.setup.surface) * self._machine.tool.count_um
        past = snapshot.carriage.position - self._plan.setup.carriage_middle
        past_mm = past / self._machine.carriage.counts_per_mm
        target_um = float(self._plan.target.at_um(angle_deg, past_mm))
        error_um = infeed_um - target_um
        # A hold retracts the tool while the carriage is still over the part: what it leaves is not judged.
        self._held = self._held or (holding and telemetry.is_leaving(error_um, self._peak_um))
        cutting = stage is CutStage.RUN_UP and self._face <= snapshot.carriage.position < self._end
        self._over = self._over or (stage is CutStage.RUN_UP and bool(self._errors) and infeed_um < 0.0)
        cutting = cutting and not self._held and not self._over
        if cutting and snapshot.program_running:
            stage = CutStage.CUT
            self._reached_mm = max(self._reached_mm, self._past_face_mm(snapshot))
            self._errors.append((angle_deg % 360.0, error_um))
            self._infeeds.append((angle_deg, infeed_um))
            trimmed_um = trim_um(self._plan, self._adjusted.applied, angle_deg, past_mm)
            self._untrimmed.append((angle_deg, infeed_um - trimmed_um))
            if AxisName.SPINDLE in snapshot.driven:
                self._turning.append((snapshot.spindle.position, snapshot.spindle.following_error))
            self._peak_um = max(self._peak_um, abs(error_um))
            self._stretches = telemetry.with_error(self._stretches, self._past_face_mm(snapshot), error_um)
        elif stage is CutStage.RUN_UP and self._errors:
            # A program stopped by somebody else leaves the tool where it is.
            stage = CutStage.CUT if cutting else CutStage.RETRACT
        return self._moment(snapshot, stage, holding, speed_rpm, infeed_um, target_um)

    def _phases(self, snapshot: Snapshot, moment: CutProgress) -> tuple[PhaseLeft, ...]:
        phase = _PHASES.get(moment.stage)
        if moment.synchronisation is Synchronisation.WAITING:
            phase = CutPhase.INDEX
        return () if phase is None else self._clock.remaining_phases(phase, snapshot, moment.left_s, self._pace)

    def _to_go(self, snapshot: Snapshot, moment: CutProgress) -> tuple[AxisToGo, ...]:
        match moment.stage:
            case CutStage.POSITION:
                return to_the_start(self._plan, self._machine, snapshot)
            case CutStage.RUN_UP | CutStage.CUT | CutStage.PAUSED:
                left_mm = (self._end - snapshot.carriage.position) / self._machine.carriage.counts_per_mm
                return (AxisToGo(AxisName.CARRIAGE, max(left_mm, 0.0)),)
            case _:
                return ()

    def _moment(
        self,
        snapshot: Snapshot,
        stage: CutStage,
        holding: bool,
        speed_rpm: float | None,
        infeed_um: float,
        target_um: float,
    ) -> CutProgress:
        machine, job = self._machine, self._job
        z_mm = min(max(self._done_mm(snapshot, stage), 0.0), job.cut_length_mm)
        per_s = self._pace * job.feed_mm_per_rev * self._plan.spindle_speed_rpm / 60.0
        angles, errors = _samples(self._errors).T
        phase, of_path = self._phase_of(self._infeeds), self._phase_of(self._untrimmed)
        return CutProgress(
            stage=stage,
            holding=holding,
            turn=z_mm / job.feed_mm_per_rev,
            turns=job.cut_length_mm / job.feed_mm_per_rev,
            z_mm=z_mm,
            length_mm=job.cut_length_mm,
            left_s=(job.cut_length_mm - z_mm) / per_s if per_s else 0.0,
            speed_rpm=speed_rpm,
            tool_radius_mm=machine.tool.home_radius_mm - snapshot.tool.position / machine.tool.counts_per_mm,
            infeed_um=infeed_um,
            tool_error_um=infeed_um - target_um,
            tool_error_peak_um=self._peak_um,
            following_error_um=snapshot.tool.following_error * machine.tool.count_um,
            phase=phase,
            path_phase=of_path,
            judged=self._judged,
            synchronisation=self._synchronisation(snapshot, stage, speed_rpm, of_path),
            ripple=telemetry.spindle_ripple(_samples(self._turning), machine.spindle.counts_per_rev),
            in_air=self._in_air,
            angles_deg=angles,
            errors_um=errors,
            phase_limit_deg=self._phase_limit_deg,
            expected_lag=self._expected_lag,
            stretches=self._stretches,
        )

    def _done_mm(self, snapshot: Snapshot, stage: CutStage) -> float:
        """Return the cut length done; after the cut it stays, wherever the carriage goes."""
        match stage:
            case CutStage.POSITION:
                return 0.0  # the carriage is still on its way to the part
            case CutStage.DONE:
                return self._job.cut_length_mm
            case CutStage.PAUSED | CutStage.RETRACT | CutStage.HELD:
                return self._reached_mm
            case _:
                return self._past_face_mm(snapshot)

    def _past_face_mm(self, snapshot: Snapshot) -> float:
        return (snapshot.carriage.position - self._face) / self._machine.carriage.counts_per_mm

    def _phase_of(self, infeeds: deque[tuple[float, float]]) -> telemetry.PhaseLag | None:
        return telemetry.phase_of(_samples(infeeds), self._plan.target) if self._judged else None

    def _synchronisation(
        self, snapshot: Snapshot, stage: CutStage, speed_rpm: float | None, phase: telemetry.PhaseLag | None
    ) -> Synchronisation | None:
        strategy, target_rpm = self._plan.strategy, self._plan.spindle_speed_rpm
        if stage is CutStage.CUT:
            in_phase = telemetry.is_in_phase(phase, self._phase_limit_deg, self._expected_lag)
            return in_part(strategy, spindle_rpm=speed_rpm, target_rpm=target_rpm, in_phase=in_phase)
        if stage is not CutStage.RUN_UP or not snapshot.program_running:
            return None
        begun = abs(snapshot.tool.position - self._plan.tool_start) * self._machine.tool.count_um > BEGUN_UM
        return before_part(strategy, spindle_rpm=speed_rpm, target_rpm=target_rpm, begun=begun)


_PHASES = {
    CutStage.POSITION: CutPhase.APPROACH,
    CutStage.RUN_UP: CutPhase.RUN_UP,
    CutStage.CUT: CutPhase.CUT,
    CutStage.PAUSED: CutPhase.CUT,
    CutStage.RETRACT: CutPhase.RETRACT,
}


def _samples(pairs: deque[tuple[float, float]]) -> NDArray[np.float64]:
    """Return pairs as rows, shape (M, 2), M may be 0."""
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)


def before_part(
    strategy: Strategy, *, spindle_rpm: float | None, target_rpm: float, begun: bool
) -> Synchronisation | None:
    """Return the synchronisation of a running program before the part is reached; None if no lobe is followed.

    `begun` is whether the tool has left its position at program start. Only a program on the spindle's time
    waits for the index, and it waits with everything at rest but the spindle.
    """
    if not strategy.traits.follows_lobe:
        return None
    at_speed = spindle_rpm is not None and abs(abs(spindle_rpm) - target_rpm) <= SPEED_BAND * target_rpm
    waits = strategy.traits.spindle_time and at_speed and not begun
    return Synchronisation.WAITING if waits else Synchronisation.QUEUED


def in_part(
    strategy: Strategy, *, spindle_rpm: float | None, target_rpm: float, in_phase: bool | None
) -> Synchronisation | None:
    """Return whether tool and spindle are synchronised in the part; None while unknown, or without a lobe.

    A stopped spindle is lost whatever the phase: the tool that follows its angle stops with it, in phase.
    """
    if not strategy.traits.follows_lobe:
        return None
    if spindle_rpm is not None and abs(spindle_rpm) < STANDS_FRACTION * target_rpm:
        return Synchronisation.LOST
    if in_phase is None:
        return None
    return Synchronisation.IN_SYNC if in_phase else Synchronisation.LOST
