"""Context of the link thread: the lathe, its chuck and gauge, and the state that it publishes."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from console.session.cut.alignment import Alignment, aligned_machine, mounted_on, table_problems
from console.session.cut.engine import CutContext, Workshop
from console.session.cut.interlocks import of_drives, of_home
from console.session.cut.recording import CutRecorder, LogRecorder
from console.session.cut.telemetry import NO_LAG, Lag
from console.session.data.measured_part import CutPart
from console.session.data.records import RunRecord
from console.session.data.run_rows import problem_events
from console.session.data.run_story import COMMAND
from console.session.errors import SessionError, refuse
from console.session.station.actions import alarm_events, command_event
from console.session.station.alarms import Alarms, Priority, clear_alarms, raise_alarm
from console.session.station.commands import Adjust, Command, HoldFeed, ResumeFeed, TakeTrace
from console.session.station.link.onlookers import Onlookers
from console.session.station.link.reopening import ConnectionReopener
from console.session.station.machine_connection import CommissioningGate
from console.session.station.machine_control import MachineControl
from console.session.station.state import ArmedCut, SessionStart, StationState
from drivers.clock import Clock, TrainingClock
from drivers.cutting.planning import CutPlan
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.client import PmacClient
from drivers.requests.side_line import SideLine
from drivers.simulator.plant.which_lathe import WhichLathe
from drivers.simulator.plant.workshop_view import Truth
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import PartSection
from profiles.problem import Problem
from profiles.store import LoadedJob, LoadedMachine
from profiles.traces import Trace


class Shop(Workshop, Protocol):
    """The workshop of a lathe on which people train: which one it is, and whether its parts differ."""

    which: WhichLathe
    parts_differ: bool

    @property
    def parts(self) -> int:
        """How many blanks were clamped on it so far."""

    def truth(self) -> Truth:
        """Return the true state of the lathe, for a debrief."""

    def fault(self, line: str) -> str:
        """Inject a fault: `inject NAME [KEY=VALUE ...]`; or end all of them: `clear`."""


class InstructedLathe(Protocol):
    """A simulated lathe in the hands of an instructor."""

    def set_speed(self, speed: float) -> None:
        """Run this many times as fast as real time; 0 pauses."""

    def checkpoint(self, name: str) -> None:
        """Freeze a copy as it is now."""

    def return_to(self, name: str) -> None:
        """Go on with a copy of what was frozen, behind another link; its time stands still."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """A lathe that was frozen, by its name, at this local time; `restore` sets what the console knew of it then.

    `fields` are those of the state that are about the lathe and its part.
    """

    name: str
    at: str
    fields: Mapping[str, Any]
    restore: Callable[[], None]


@dataclass(frozen=True, kw_only=True)
class FiledPart:
    """The last part that was judged by a file: what was chosen, its cut, and its job, `loaded` if it was saved."""

    command: TakeTrace
    cut: CutPart
    job: Job
    loaded: LoadedJob | None


@dataclass(kw_only=True, eq=False)
class Training:
    """A lathe in the hands of an instructor, and its time: `speed` is that of the time when it is not paused.

    `returning` is the checkpoint to which the lathe has just gone back, until the link to it is open.
    """

    lathe: InstructedLathe
    clock: TrainingClock
    speed: float = 1.0
    checkpoints: dict[str, Checkpoint] = field(default_factory=dict)
    returning: Checkpoint | None = None


@dataclass(kw_only=True, eq=False)
class StationContext:
    """Everything that one command needs. `state` is replaced by `tell`, from any thread.

    Without `commissioned` stopping record, fingerprint and safety devices go unchecked: for tests only. Without
    `reopening` a lost link stays lost, without `onlookers` nobody is counted who looks on. `client` is that of the
    controller, for what the lathe has no function for. `plan` is that of the
    last arming, `started` what was last started; `seen` gets every status poll during a cut.
    `limits_seen` are the travel limits on which the machine stood when the operator reset after a stop: it may be
    jogged off them. `end_asked` is set by the operator; `Lathe.held` reports when it has been passed on.
    `hold_asked` is the last command about a feed hold not yet passed on, `adjust_asked` those about override and
    trim, `faults_asked` faults for the simulated lathe, `orders` those of its instructor, for which it
    is in `training`. `parts` counts the cuts of this session that were made to their end. `side` sends what worker
    threads ask, between two polls. `pause_problem` says why an order without a date is not obeyed just now.
    `begins` is how a simulated lathe is taken over, None at power-up. `reading` is what the simulated gauge read
    of the last part, None after a file was taken; that is `filed` then.
    """

    lathe: Lathe
    owning: MachineControl
    loaded_machine: LoadedMachine
    clock: Clock
    shop: Shop | None
    records: Path
    local_time: Callable[[], str]
    commissioned: CommissioningGate | None = None
    side: SideLine | None = None
    reopening: ConnectionReopener | None = None
    onlookers: Onlookers | None = None
    client: PmacClient | None = None
    plan: CutPlan | None = None
    expected_lag: Lag = NO_LAG
    started: ArmedCut | None = None
    reading: tuple[Trace, tuple[PartSection, ...]] | None = None
    filed: FiledPart | None = None
    record: RunRecord | None = None
    seen: Callable[[Snapshot], None] | None = None
    limits_seen: frozenset[str] = frozenset()
    end_asked: bool = False
    hold_asked: HoldFeed | ResumeFeed | None = None
    adjust_asked: deque[Adjust] = field(default_factory=deque)
    faults_asked: deque[str] = field(default_factory=deque)
    begins: SessionStart | None = None
    orders: deque[Callable[[StationContext], None]] = field(default_factory=deque)
    training: Training | None = None
    parts: int = 0
    pause_problem: Callable[[], Problem | None] = lambda: None
    _incomplete_told: bool = field(default=False, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)
    _state: StationState = field(init=False)

    def __post_init__(self) -> None:
        machine = self.loaded_machine.machine
        self._state = StationState(
            simulated=self.shop is not None,
            lathe="" if self.shop is None else str(self.shop.which),
            machine=machine.name,
            standing=ConsoleRole.OBSERVER,
            alignment=Alignment(on=mounted_on(machine)),
        )

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._state

    @property
    def machine(self) -> MachineProfile:
        """The machine with the tool tip from the touch-off."""
        return aligned_machine(self.loaded_machine.machine, self._state.alignment)

    @property
    def cut_context(self) -> CutContext:
        """The machine as a cut needs it."""
        recorder = CutRecorder() if self.record is None else LogRecorder(self.record.log)
        context = CutContext(lathe=self.lathe, workshop=self.shop, recorder=recorder)
        if self.commissioned is None:
            return context
        return replace(context, commissioned=self.commissioned.problems)

    def refuse_unless_homed(self) -> None:
        """Refuse unless the drives are enabled and the zeros known: `alignment.drives_off`, `alignment.not_homed`.

        Also while a table is left on (`cut.table_on`): it would move the tool with the carriage and the spindle.
        """
        refuse(of_drives(self.lathe.snapshot()).problems)
        refuse(table_problems(self._state.alignment))
        refuse(of_home(self.lathe.snapshot()).problems)

    def tell(self, **changes: Any) -> None:
        """Publish a state with these fields changed."""
        with self._lock:
            self._state = replace(self._state, **changes)

    def tell_standing(self) -> None:
        """Publish who controls the machine."""
        ownership = self.lathe.ownership
        if ownership is None:
            standing, holder = ConsoleRole.OWNER, self._state.holder
        else:
            standing, holder = ownership.standing, ownership.holder
        if (standing, holder) != (self._state.standing, self._state.holder):  # it seldom changes
            self.tell(standing=standing, holder=holder)

    def alarm(self, problem: Problem, priority: Priority = Priority.HIGH) -> None:
        """Raise an alarm."""
        self.change_alarms(lambda alarms: raise_alarm(alarms, problem, priority, self.clock.now_s()))

    def alarm_once(self, problem: Problem, priority: Priority = Priority.HIGH) -> None:
        """Raise an alarm unless one of its code is present."""
        if not self.has_alarm(problem.code):
            self.alarm(problem, priority)

    def alarm_new(self, problems: tuple[Problem, ...]) -> None:
        """Raise an alarm for each problem that none reports as it is now."""
        for problem in problems:
            if not self.alarmed_of(problem):
                self.alarm(problem)

    def screen_s(self) -> float:
        """Return the time by which a screen is alive: real time, however fast a simulated lathe runs."""
        return self.clock.now_s() if self.training is None else self.training.clock.real_s()

    def change_alarms(self, change: Callable[[Alarms], Alarms]) -> None:
        """Publish changed alarms; alarms that another thread raises meanwhile are kept."""
        with self._lock:
            before = self._state.alarms
            after = change(before)
            if after == before:
                return
            self._state = replace(self._state, alarms=after)
            if self.record is not None:
                for kind, data in alarm_events(before, after):
                    self.record.log.event(kind, data)

    def end_alarms(self, *codes: str) -> None:
        """End these alarms, whose cause is gone."""
        if self._state.alarms:  # most polls find none
            self.change_alarms(lambda alarms: clear_alarms(alarms, *codes))

    def has_alarm(self, code: str) -> bool:
        """Whether an alarm of this code is present."""
        return any(alarm.active and alarm.problem.code == code for alarm in self._state.alarms)

    def alarmed_of(self, problem: Problem) -> bool:
        """Whether an alarm of exactly this problem is present."""
        return any(alarm.active and alarm.problem == problem for alarm in self._state.alarms)

    def open_record(self, record: RunRecord) -> None:
        """Record from now on, beginning with the active alarms: a cleared alarm belongs to another run."""
        with self._lock:
            self.record = record
            standing = tuple(alarm for alarm in self._state.alarms if alarm.active)
            for kind, data in alarm_events((), standing):
                record.log.event(kind, data)

    def log_command(self, command: Command) -> None:
        """Add a command of the operator to the record of the current cut, if there is one; never waits."""
        record = self.record
        if record is not None:
            record.log.event(COMMAND, command_event(command))

    def log_refusal(self, problems: Iterable[Problem]) -> None:
        """Add why the last command was refused, as `log_command`."""
        record = self.record
        if record is not None:
            record.log.event("refused", problem_events(problems))

    def check_record(self) -> None:
        """Raise an alarm once telemetry, commands or alarms are missing from the record; the cut continues."""
        missing = None if self.record is None else self.record.log.problem
        if missing is not None and not self._incomplete_told:
            self._incomplete_told = True
            self.alarm(missing, Priority.MEDIUM)

    def note(self, kind: str, **data: object) -> None:
        """Add an event to the record of the current cut, if there is one; SessionError `record.lost`."""
        if self.record is not None:
            self.record.add(kind, data)

    def note_anyway(self, kind: str, **data: object) -> None:
        """Add an event where a record failure must not stop anything: it becomes an alarm."""
        try:
            self.note(kind, **data)
        except SessionError as error:
            self.alarm(error.problems[0], Priority.MEDIUM)

    def end_record(self, *, marked: bool = False) -> None:
        """Complete the record of this cut, and report a lost record. `marked`: the next start reports the mark."""
        if self.record is not None:
            try:
                self.record.refuse_lost()
            except SessionError as lost:
                self.alarm(lost.problems[0], Priority.MEDIUM)
            self.record.close(marked=marked)
            self.check_record()
            self.record, self._incomplete_told = None, False
