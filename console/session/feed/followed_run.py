"""What a feed observes of `console run`: who cuts leaves references, the thread of the feed does the rest.

Its alarms are made from the status polls: what the controller reports, and a motion that lost its host.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import linear_regression
from typing import Protocol

from console.session.cut.cut_verdict import CutVerdict
from console.session.cut.engine import PartStep
from console.session.cut.recording import CutRecorder
from console.session.feed.observed_state import RUN, ObservedState, ShownCut
from console.session.station.actions import alarm_events
from console.session.station.alarms import AT_REST, IN_PROGRAM, Alarms, Priority, raise_alarm, with_faults
from console.session.station.state import Activity, StationState, StopState
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import Batch
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import CylinderResult, PartSection
from profiles.metrology.uncertainty import UncertaintyBudget
from profiles.problem import Problem
from profiles.traces import Trace

POLLS = 40  # about a second of polls, over which the speed is averaged

_ACTIVITIES = {
    PartStep.LOAD: Activity.WRITING,
    PartStep.CHECK: Activity.VERIFYING,
    PartStep.ALIGN: Activity.HOMING,
    PartStep.ARM: Activity.ARMING,
    PartStep.CUT: Activity.CUTTING,
    PartStep.RETRACT: Activity.RETRACTING,
    PartStep.MEASURE: Activity.MEASURING,
}
Note = Callable[[str, Mapping[str, object]], object]
"""Adds an event to the record of the run; returns at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What is cut: a job on a machine, recorded as `run_id`. In `air` nothing is cut."""

    job: str
    machine: MachineProfile
    run_id: str
    simulated: bool
    air: bool = False


class GuardedMotion(Protocol):
    """The heartbeat of the machine, as far as it is asked here."""

    def loss(self, lost: int) -> Problem | None:
        """Return why something was ended without its host; `lost` is what the controller reports of it."""


class RunAlarms:
    """What stands now. Nobody acknowledges: an alarm ends with its cause, that of a lapse with the next motion."""

    def __init__(self, note: Note = lambda *_: None) -> None:
        self.standing: Alarms = ()
        self.heartbeat: GuardedMotion | None = None
        self._note = note

    def see(self, snapshot: Snapshot, during: str) -> None:
        """Take a poll, `during` rest or a program; returns at once."""
        loss = None if self.heartbeat is None else self.heartbeat.loss(snapshot.lost)
        if not (self.standing or loss or snapshot.axis_faults):
            return
        faults = tuple(alarm for alarm in self.standing if alarm.faults)
        after = with_faults(faults, snapshot.axis_faults, snapshot.at_s, during)
        if loss is not None:
            before = tuple(alarm for alarm in self.standing if alarm.problem == loss)
            after = (*after, *before) if before else raise_alarm(after, loss, Priority.HIGH, snapshot.at_s)
        after = tuple(alarm for alarm in after if alarm.active)
        for kind, data in alarm_events(self.standing, after):
            self._note(kind, data)
        self.standing = after


class FollowedRun(CutRecorder):
    """A recorder that passes everything on to another one; `stop` is that of a machine behind a link.

    Everything that the cutting thread calls returns at once.
    """

    def __init__(self, run: Run, recorder: CutRecorder, alarms: RunAlarms | None = None) -> None:
        self.stop: StopPath | None = None
        self.alarms = alarms or RunAlarms()
        self._run, self._recorder = run, recorder
        self._state = StationState(
            machine=run.machine.name, simulated=run.simulated, standing=ConsoleRole.OBSERVER
        )
        self._polls: deque[Snapshot] = deque(maxlen=POLLS)
        self._cut: tuple[CutPlan, Job, MachineProfile] | None = None
        self._parts = 0
        self._verdict: CutVerdict | None = None

    def take_step(self, step: PartStep) -> None:
        """Take a step of a part, which begins; the program of a cut that is retracted has made its part."""
        self._parts += step is PartStep.RETRACT and not self._run.air
        self._state = replace(self._state, activity=_ACTIVITIES[step], standing=ConsoleRole.OWNER)

    def take_poll(self, snapshot: Snapshot) -> None:
        """Take a status poll."""
        if not self._polls or self._polls[-1] is not snapshot:
            self._polls.append(snapshot)
            self.alarms.see(snapshot, AT_REST if self._cut is None else IN_PROGRAM)

    def part(self, name: str, *, product: bool) -> None:
        """Pass on the name of the cuts that follow."""
        self._recorder.part(name, product=product)

    def begin(self, plan: CutPlan, job: Job, machine: MachineProfile) -> None:
        """Begin a cut."""
        self._cut, self._verdict = (plan, job, machine), None
        self._recorder.begin(plan, job, machine)

    def see(self, snapshot: Snapshot) -> None:
        """Take a status poll of the program."""
        self.take_poll(snapshot)
        self._recorder.see(snapshot)

    def end(self) -> None:
        """End the cut."""
        self._cut = None
        self._recorder.end()

    def record_verdict(self, verdict: CutVerdict) -> None:
        """Take the verdict on the cut that has ended."""
        self._verdict = verdict
        self._recorder.record_verdict(verdict)

    def record_window(self, batch: Batch) -> None:
        """Pass on a window that the controller has sampled."""
        self._recorder.record_window(batch)

    def record_band(self, event: Mapping[str, object]) -> None:
        """Pass on what a trial band has shown."""
        self._recorder.record_band(event)

    def record_measured_part(
        self,
        job: Job,
        trace: Trace,
        whole: CylinderResult | None,
        sections: Sequence[PartSection],
        budget: UncertaintyBudget | None,
    ) -> None:
        """Pass on the measured part."""
        self._recorder.record_measured_part(job, trace, whole, sections, budget)

    def observe_state(self, now_s: Callable[[], float] = time.monotonic) -> ObservedState:
        """Return this moment, in the thread of the feed. Simulated time that is not real has no age.

        Whatever ends a run without an alarm ends this process, and the feed.
        """
        polls, state, cut, run = list(self._polls), self._state, self._cut, self._run
        newest = polls[-1] if polls else None
        at_s = newest.at_s if newest is not None and self.stop is None else now_s()
        stop = self.stop
        if stop is not None and stop.reason is not None:
            stopped = StopState(reason=stop.reason, killed=stop.killed, sent_s=at_s)
            activity = Activity.STOPPED if stop.proven else Activity.STOPPING
            state = replace(state, stop=stopped, activity=activity)
        state = replace(state, snapshot=newest, at_s=at_s, alarms=self.alarms.standing)
        return ObservedState(
            state=replace(state, spindle_rpm=_rpm(polls, run.machine)),
            machine=run.machine,
            now_s=at_s,
            program=RUN,
            job=run.job,
            run_id=run.run_id,
            parts=self._parts,
            verdict=self._verdict,
            cut=None if cut is None or newest is None else _describe_cut(newest, *cut),
        )


def _rpm(polls: list[Snapshot], machine: MachineProfile) -> float | None:
    """Return the speed over these polls; None for too few, or where a controller was homed between them."""
    homed = polls[-1].spindle.flags & {"home_complete"} if polls else frozenset()
    same = [poll for poll in polls if poll.spindle.flags & {"home_complete"} == homed]
    if len(same) < 2 or same[-1].at_s == same[0].at_s:
        return None
    turns = [poll.spindle.position / machine.spindle.counts_per_rev for poll in same]
    return 60.0 * linear_regression([poll.at_s for poll in same], turns).slope


def _describe_cut(snapshot: Snapshot, plan: CutPlan, job: Job, machine: MachineProfile) -> ShownCut:
    """Return how far a program is, by the place of the carriage; the error of the tool against its target path."""
    end = plan.carriage_start + plan.setup.carriage_counts
    left_mm = (end - snapshot.carriage.position) / machine.carriage.counts_per_mm
    z_mm = min(max(job.cut_length_mm - left_mm, 0.0), job.cut_length_mm)
    angle_deg = 360.0 * snapshot.spindle.position / machine.spindle.counts_per_rev
    infeed_um = (snapshot.tool.position - plan.setup.surface) * machine.tool.count_um
    per_s = job.feed_mm_per_rev * plan.spindle_speed_rpm / 60.0
    return ShownCut(
        stage="cut" if 0.0 < z_mm < job.cut_length_mm else "run_up" if z_mm == 0.0 else "retract",
        turn=z_mm / job.feed_mm_per_rev,
        turns=job.cut_length_mm / job.feed_mm_per_rev,
        left_s=(job.cut_length_mm - z_mm) / per_s if per_s else 0.0,
        tool_error_um=infeed_um - float(plan.target.at_um(angle_deg, z_mm - 0.5 * job.cut_length_mm)),
    )
