"""The lathe as the console sees it: axes by name, states read back, every wait bounded.

The controller is the source of truth: what is commanded is read back before it counts as done, and nothing
that moves is sent twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.pmac.axes import read_definitions
from drivers.pmac.client import PmacClient
from drivers.pmac.language.text import format_line, format_number
from drivers.pmac.program_text import ProgramText
from drivers.pmac.status import MOTOR_BITS, SYSTEM_BITS, decode
from drivers.stop import StopPath
from profiles.machine import MachineProfile
from profiles.problem import Problem

CUT_POLL_S = 0.023
"""Time between two looks during a cut: no whole part of any usual turn, so that every angle is met."""

JOG_POLL_S = 0.1
"""Time between two looks at an axis on its way."""

REST_TIMEOUT_S = 15.0
STOP_REPEAT_S = 0.2
LOOKS_AT_REST = 3
"""Looks in a row that must find nothing moving: a coasting axis creeps at the end."""

QUERY_BATCH = 10
MODAL_SETTINGS = ("I187", "I188", "I189")


class AxisName(StrEnum):
    """The axes by their machine names."""

    TOOL = "tool"
    SPINDLE = "spindle"
    CARRIAGE = "carriage"


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisState:
    """One axis as the controller reports it, in counts of its motor."""

    position: float
    following_error: float
    flags: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """Everything read in one request; `at_s` is machine time."""

    at_s: float
    tool: AxisState
    spindle: AxisState
    carriage: AxisState
    program_running: bool
    runtime_error: bool

    @property
    def axes(self) -> tuple[AxisState, AxisState, AxisState]:
        """Tool, spindle, carriage."""
        return self.tool, self.spindle, self.carriage

    @property
    def loops_closed(self) -> bool:
        """Whether every axis is under control."""
        return all("amplifier_enabled" in a.flags and "open_loop" not in a.flags for a in self.axes)

    @property
    def at_rest(self) -> bool:
        """Whether nothing is commanded to move and no program is left."""
        return not self.program_running and all("desired_velocity_zero" in a.flags for a in self.axes)

    @property
    def in_position(self) -> bool:
        """Whether every axis has arrived."""
        return not self.program_running and all("in_position" in a.flags for a in self.axes)

    @property
    def homed(self) -> bool:
        """Whether every axis has found its zero."""
        return all("home_complete" in a.flags for a in self.axes)

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the fault bits that are set, by axis."""
        names = ("fatal_following_error", "amplifier_fault", "negative_limit", "positive_limit")
        pairs = zip(AxisName, self.axes, strict=True)
        found = [f"{axis}: {name}" for axis, state in pairs for name in names if name in state.flags]
        return tuple(found + (["program: runtime_error"] if self.runtime_error else []))


class Lathe:
    """One machine at the end of one link. Methods that move check the stop first and wait for the end."""

    def __init__(self, client: PmacClient, machine: MachineProfile, clock: Clock, stop: StopPath) -> None:
        self.machine = machine
        self.stop = stop
        self._client = client
        self._clock = clock
        self._motors = {
            AxisName.TOOL: machine.tool.motor,
            AxisName.SPINDLE: machine.spindle.motor,
            AxisName.CARRIAGE: machine.carriage.motor,
        }

    def connect(self) -> tuple[str, str]:
        """Set the link up; return version and type of the controller.

        Raises:
            LinkError: nothing answers, or not like a PMAC.
        """
        return self._client.connect()

    def verify(self) -> tuple[Problem, ...]:
        """Compare the controller's settings and axis definitions with the machine profile; nothing is written.

        TA, TS and F of the coordinate system are left out: they are what the last program left behind.
        """
        wanted = {
            name: value for name, value in self.machine.controller.variables.items() if name not in MODAL_SETTINGS
        }
        names = sorted(wanted, key=lambda name: int(name[1:]))
        problems = []
        for start in range(0, len(names), QUERY_BATCH):
            batch = names[start : start + QUERY_BATCH]
            for name, found in zip(batch, self._client.numbers(*batch), strict=True):
                if found != wanted[name]:
                    value, limit = format_number(found), format_number(wanted[name])
                    problems.append(Problem(code="controller.setting", key=name, value=value, limit=limit))
        for definition in read_definitions(self.machine.controller.axis_definitions):
            (found_text,) = self._client.query(f"#{definition.motor}->")
            if found_text.strip() != str(definition):
                key = f"#{definition.motor}->"
                problems.append(
                    Problem(code="controller.setting", key=key, value=found_text, limit=str(definition))
                )
        return tuple(problems)

    def snapshot(self) -> Snapshot:
        """Read the state of the machine in one request.

        Raises:
            LinkError: the link broke or is out of step.
        """
        items = []
        for motor in self._motors.values():
            items += [f"#{motor}P", "F", "?"]
        try:
            replies = self._client.query(*items, "&1??")
        except DriverError:
            # What the drives do now is not known, so the stop must not rely on it.
            self.stop.loops_closed = False
            raise
        axes = []
        for index in range(len(self._motors)):
            position, error, status = replies[3 * index : 3 * index + 3]
            axes.append(
                AxisState(
                    position=float(position),
                    following_error=float(error),
                    flags=decode(status, MOTOR_BITS),
                )
            )
        system = decode(replies[-1], SYSTEM_BITS)
        snapshot = Snapshot(
            at_s=self._clock.now_s(),
            tool=axes[0],
            spindle=axes[1],
            carriage=axes[2],
            program_running="running_program" in system,
            runtime_error="runtime_error" in system,
        )
        self.stop.loops_closed = snapshot.loops_closed
        return snapshot

    def enable(self) -> None:
        """Close the loops of all axes where they stand.

        Raises:
            DriverError: `machine.not_enabled`, an axis does not close.
        """
        for motor in self._motors.values():
            self._move(f"#{motor}J/")
        if not self.snapshot().loops_closed:
            raise DriverError(Problem(code="machine.not_enabled", where=self._client.link.address))

    def home(self, timeout_s: float = 60.0) -> None:
        """Search the zero of each axis: tool out first, then the carriage, then the spindle's index.

        Raises:
            DriverError: `machine.timeout` or `machine.fault`.
        """
        for axis in (AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE):
            self._move(f"#{self._motors[axis]}HM")
            self._wait(partial(_arrived, axis=axis, flag="home_complete"), timeout_s, f"home {axis}")

    def jog_to(self, axis: AxisName, counts: float, timeout_s: float = 120.0) -> None:
        """Jog one axis to a position in counts of its motor.

        Raises:
            DriverError: `machine.timeout` or `machine.fault`.
        """
        self._move(f"#{self._motors[axis]}J={format_number(counts)}")
        self._wait(partial(_arrived, axis=axis, flag="in_position"), timeout_s, f"jog {axis}")

    def load(self, program: ProgramText) -> None:
        """Send a program, read it back and compare.

        Raises:
            ControllerError: a line was refused.
            DriverError: `controller.program_differs`, the buffer does not hold what was sent.
        """
        self.stop.check()
        self._client.request("CLOSE")
        self._client.download(program.lines)
        found = self._client.request(f"LIST PROG{program.number}")
        wanted = tuple(format_line(line) for line in program.program)
        if found != wanted:
            pairs = zip((*found, ""), (*wanted, ""), strict=False)
            place, (value, limit) = next((n, p) for n, p in enumerate(pairs, start=1) if p[0] != p[1])
            raise DriverError(
                Problem(
                    code="controller.program_differs",
                    where=f"PROG {program.number}",
                    key=f"line {place}",
                    value=value,
                    limit=limit,
                )
            )

    def start(self, number: int) -> None:
        """Run a loaded program. This moves the machine."""
        self._move(f"&1B{number}R")

    def follow(self, watch: Callable[[Snapshot], None], timeout_s: float) -> Snapshot:
        """Look at the machine until the program has ended and the axes have arrived.

        Raises:
            DriverError: `machine.fault`, `machine.timeout`; the machine is stopped before it is raised.
            StoppedError: somebody stopped the machine.
        """
        return self._wait(lambda s: s.in_position, timeout_s, "program", watch)

    def wait_for_rest(self, timeout_s: float = REST_TIMEOUT_S) -> Snapshot:
        """After a stop: repeat it until the controller proves that nothing moves.

        Raises:
            DriverError: `machine.not_at_rest`.
        """
        deadline = self._clock.now_s() + timeout_s
        before = self.snapshot()
        looks_at_rest = 0
        while True:
            self._clock.wait(STOP_REPEAT_S)
            snapshot = self.snapshot()
            still = all(
                abs(a.position - b.position) <= 1.0 for a, b in zip(snapshot.axes, before.axes, strict=True)
            )
            looks_at_rest = looks_at_rest + 1 if snapshot.at_rest and still else 0
            if looks_at_rest == LOOKS_AT_REST:
                return snapshot
            if self._clock.now_s() > deadline:
                raise DriverError(Problem(code="machine.not_at_rest", value=f"{timeout_s:g} s"))
            if not snapshot.at_rest:
                self.stop.repeat()
            before = snapshot

    def _move(self, line: str) -> None:
        self.stop.check()
        try:
            self._client.request(line)
        except DriverError:
            self.stop.loops_closed = False
            raise

    def _wait(
        self,
        done: Callable[[Snapshot], bool],
        timeout_s: float,
        what: str,
        watch: Callable[[Snapshot], None] | None = None,
    ) -> Snapshot:
        deadline = self._clock.now_s() + timeout_s
        while True:
            self._clock.wait(JOG_POLL_S if watch is None else CUT_POLL_S)
            self.stop.check()
            snapshot = self.snapshot()
            if snapshot.faults:
                self.stop.stop(snapshot.faults[0])
                raise DriverError(Problem(code="machine.fault", key=what, value=", ".join(snapshot.faults)))
            if watch is not None:
                watch(snapshot)
            if done(snapshot):
                return snapshot
            if self._clock.now_s() > deadline:
                self.stop.stop(f"{what}: {timeout_s:g} s")
                raise DriverError(Problem(code="machine.timeout", key=what, value=f"{timeout_s:g} s"))


def _arrived(snapshot: Snapshot, axis: AxisName, flag: str) -> bool:
    state: AxisState = getattr(snapshot, axis.value)
    return flag in state.flags and "in_position" in state.flags and "home_search" not in state.flags
