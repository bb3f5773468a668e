"""One status poll of the machine: everything that a single request returns, immutable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto
from types import MappingProxyType

from profiles.machine import MachineProfile

FAULT_FLAGS = ("fatal_following_error", "amplifier_fault", "negative_limit", "positive_limit")
REAL_TIME_PERCENT = 100.0


class AxisName(StrEnum):
    """The axes, by their machine names."""

    TOOL = auto()
    SPINDLE = auto()
    CARRIAGE = auto()


@dataclass(frozen=True, slots=True)
class AxisState:
    """One axis as the controller reports it, in counts of its motor."""

    position: float
    following_error: float
    flags: frozenset[str]

    @property
    def commanded_position(self) -> float:
        """The commanded position: actual position plus following error."""
        return self.position + self.following_error

    @property
    def closed(self) -> bool:
        """Whether the axis is in closed loop."""
        return "amplifier_enabled" in self.flags and "open_loop" not in self.flags


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """Everything read in one request, sent at `asked_s` and answered at `at_s` (machine time).

    `driven` are the axes that the controller moves; a spindle on an inverter is only read. `owner` is the
    number of the console that controls the machine, 0 nobody. `lost` is what the controller has ended without a
    host: 1 a jog, 2 a cut, 0 nothing. `inputs` are the safety devices that the controller sees, True in the
    safe state. `override_percent` is the time base of programs, 100 for real time: a feed hold makes it 0.
    `shifted` are the axes that were found elsewhere than this console left them, by how much: they have no home.
    """

    asked_s: float
    at_s: float
    tool: AxisState
    spindle: AxisState
    carriage: AxisState
    program_running: bool
    runtime_error: bool
    driven: tuple[AxisName, ...] = tuple(AxisName)
    owner: int = 0
    lost: int = 0
    override_percent: float = REAL_TIME_PERCENT
    inputs: Mapping[str, bool] = field(default_factory=lambda: MappingProxyType({}))
    shifted: Mapping[AxisName, str] = field(default_factory=dict)

    def age_s(self, now_s: float) -> float:
        """Return the maximum age of the data: each value was sampled at some moment after the request."""
        return now_s - self.asked_s

    @property
    def axes(self) -> tuple[AxisState, AxisState, AxisState]:
        """Tool, spindle, carriage."""
        return self.tool, self.spindle, self.carriage

    def axis(self, name: AxisName) -> AxisState:
        """Return one axis by its name, which is that of its field."""
        state: AxisState = getattr(self, name)
        return state

    @property
    def driven_axes(self) -> tuple[AxisState, ...]:
        """The axes that the controller moves."""
        return tuple(self.axis(name) for name in self.driven)

    @property
    def loops_closed(self) -> bool:
        """Whether every driven axis is in closed loop."""
        return not self.open_loops

    @property
    def nothing_open(self) -> bool:
        """Whether no axis is in open loop, driven or not: a control-A would close it."""
        return all(axis.closed for axis in self.axes)

    @property
    def loops_open(self) -> bool:
        """Whether every axis is disabled."""
        return all("amplifier_enabled" not in a.flags for a in self.axes)

    @property
    def at_rest(self) -> bool:
        """Whether no motion is commanded and no program is left."""
        return not self.program_running and all("desired_velocity_zero" in a.flags for a in self.axes)

    def obeys_stop(self, *, killed: bool) -> bool:
        """Whether the controller has obeyed a stop: every loop is open, or every axis ramps down or rests."""
        if killed:
            return self.loops_open
        ramping = all({"abort_deceleration", "desired_velocity_zero"} & axis.flags for axis in self.driven_axes)
        return ramping and not self.program_running

    @property
    def moving(self) -> bool:
        """Whether motion is commanded or a program is left."""
        return not self.at_rest

    @property
    def in_position(self) -> bool:
        """Whether every axis has arrived."""
        return not self.program_running and all("in_position" in a.flags for a in self.driven_axes)

    @property
    def open_loops(self) -> tuple[AxisName, ...]:
        """The driven axes that are in open loop."""
        return tuple(axis for axis in self.driven if not self.axis(axis).closed)

    @property
    def homed_axes(self) -> frozenset[AxisName]:
        """The axes that are homed."""
        return frozenset(axis for axis in self.driven if "home_complete" in self.axis(axis).flags)

    @property
    def homed(self) -> bool:
        """Whether every driven axis is homed."""
        return self.homed_axes == frozenset(self.driven)

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the fault bits that are set, by axis, and that of a program that ended with an error."""
        return (*self.axis_faults, *(("program: runtime_error",) if self.runtime_error else ()))

    @property
    def axis_faults(self) -> tuple[str, ...]:
        """The same without the program, whose error stays set until the next one runs."""
        if all(state.flags.isdisjoint(FAULT_FLAGS) for state in self.axes):
            return ()
        pairs = zip(AxisName, self.axes, strict=True)
        return tuple(f"{axis}: {name}" for axis, state in pairs for name in FAULT_FLAGS if name in state.flags)

    @property
    def limits(self) -> frozenset[str]:
        """The faults that are travel limits: an axis may stand on one, and be jogged off it."""
        return frozenset(fault for fault in self.axis_faults if fault.endswith("_limit"))

    def still(self, other: Snapshot, counts: float) -> bool:
        """Whether no axis, driven or not, has moved by more than `counts`."""
        return all(abs(a.position - b.position) <= counts for a, b in zip(self.axes, other.axes, strict=True))


def driven_axes(machine: MachineProfile) -> tuple[AxisName, ...]:
    """Return the axes that the controller moves."""
    return tuple(axis for axis in AxisName if axis is not AxisName.SPINDLE or not machine.spindle.followed)
