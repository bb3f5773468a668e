"""One look at the machine: everything that a single request brings back, immutable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from drivers.errors import LinkError
from drivers.pmac.dialect import Dialect
from drivers.pmac.status import decode
from profiles.problem import Problem

FAULT_FLAGS = ("fatal_following_error", "amplifier_fault", "negative_limit", "positive_limit")
ITEMS_PER_AXIS = 3


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

    @property
    def closed(self) -> bool:
        """Whether the axis is under control."""
        return "amplifier_enabled" in self.flags and "open_loop" not in self.flags


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

    def axis(self, name: AxisName) -> AxisState:
        """Return one axis by its name."""
        return dict(zip(AxisName, self.axes, strict=True))[name]

    @property
    def loops_closed(self) -> bool:
        """Whether every axis is under control."""
        return all(axis.closed for axis in self.axes)

    @property
    def loops_open(self) -> bool:
        """Whether every axis is switched off."""
        return all("amplifier_enabled" not in a.flags for a in self.axes)

    @property
    def at_rest(self) -> bool:
        """Whether nothing is commanded to move and no program is left."""
        return not self.program_running and all("desired_velocity_zero" in a.flags for a in self.axes)

    @property
    def moving(self) -> bool:
        """Whether something is commanded to move, or a program is left."""
        return not self.at_rest

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
        """Names of the fault bits that are set, by axis, and that of a program that ended with an error."""
        return (*self.axis_faults, *(("program: runtime_error",) if self.runtime_error else ()))

    @property
    def axis_faults(self) -> tuple[str, ...]:
        """The same without the program: its error stays set until the next one runs."""
        pairs = zip(AxisName, self.axes, strict=True)
        return tuple(f"{axis}: {name}" for axis, state in pairs for name in FAULT_FLAGS if name in state.flags)

    def near(self, other: Snapshot, counts: float) -> bool:
        """Whether no axis is further than `counts` from where it was in `other`."""
        return all(abs(a.position - b.position) <= counts for a, b in zip(self.axes, other.axes, strict=True))


def snapshot_items(motors: Sequence[int]) -> tuple[str, ...]:
    """Return what to ask for: position, following error and status of each motor, then the program's status."""
    items = [item for motor in motors for item in (f"#{motor}P", "F", "?")]
    return (*items, "&1??")


def _flags(status: str, dialect: Dialect) -> frozenset[str]:
    """Return the flags of a motor. In open loop the card reports no desired velocity, and so none that is zero."""
    flags = decode(status, dialect.motor_bits)
    return flags | {"desired_velocity_zero"} if "open_loop" in flags else flags


def read_snapshot(replies: Sequence[str], at_s: float, where: str, dialect: Dialect) -> Snapshot:
    """Make a snapshot of the replies to `snapshot_items`.

    Raises:
        LinkError: `link.out_of_step`, a reply is not what was asked for.
    """
    try:
        axes = [
            AxisState(position=float(position), following_error=float(error), flags=_flags(status, dialect))
            for position, error, status in (
                replies[start : start + ITEMS_PER_AXIS] for start in range(0, len(replies) - 1, ITEMS_PER_AXIS)
            )
        ]
        system = decode(replies[-1], dialect.system_bits)
    except ValueError as error:
        raise LinkError(Problem(code="link.out_of_step", where=where, key="P F ? ??", value=str(error))) from error
    return Snapshot(
        at_s=at_s,
        tool=axes[0],
        spindle=axes[1],
        carriage=axes[2],
        program_running="running_program" in system,
        runtime_error="runtime_error" in system,
    )
