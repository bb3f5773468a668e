"""Operator commands as values, and the interface that takes them. Stop and kill have a path of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from drivers.lathe.snapshot import AxisName

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from console.session.station.state import StationState
    from drivers.beside.side_line import SideLine
    from drivers.cutting.strategy import Strategy
    from profiles.compensations.learned import LearnedCompensation
    from profiles.job import Job
    from profiles.problem import Problem
    from profiles.store import LoadedJob


@dataclass(frozen=True)
class Command:
    """One command; those without fields differ by their class alone."""


class Verify(Command):
    """Compare the controller's settings with the machine profile again. Nothing moves."""


@dataclass(frozen=True, kw_only=True)
class ConfirmClamping(Command):
    """The blank of this job is clamped with its chucking force. Drives must be off: somebody was inside."""

    job: Job


class EnableDrives(Command):
    """Close the loops of all axes at their present positions."""


class DisableDrives(Command):
    """Open all loops, at rest."""


class Home(Command):
    """Home each axis: tool outwards first."""


@dataclass(frozen=True, kw_only=True)
class Approach(Command):
    """Bring the tool over the part, clear of it by the machine's retract distance: for the touch-off."""

    job: Job


@dataclass(frozen=True, kw_only=True)
class Jog(Command):
    """One step of one axis: mm towards the work or the chuck, degrees in the direction of the cut; signed."""

    axis: AxisName
    distance: float


class TakeJaw(Command):
    """Record the present spindle angle as the one at which jaw 1 meets the mark."""


@dataclass(frozen=True, kw_only=True)
class TakeTouchOff(Command):
    """Record that the tool tip touches a surface of this radius at its present position."""

    radius_mm: float


class Forget(Command):
    """Forget the touch-off, or jaw 1 where there is none, to take it again."""


@dataclass(frozen=True, kw_only=True)
class Arm(Command):
    """Plan, load, read back and check a cut; start is allowed for some seconds after it.

    `loaded` is the file that the job is from, None where it differs from it: then nothing was learned of it.
    `compensation` is what was learned of it, None the model's; `stage` is a `console.session.stages.Stage`.
    """

    job: Job
    job_sha256: str
    strategy: Strategy
    loaded: LoadedJob | None = None
    compensation: LearnedCompensation | None = None
    stage: str = "full"


class Disarm(Command):
    """Disarm the cut."""


class Start(Command):
    """Go to the start position and run the armed cut."""


class EndCut(Command):
    """End the cut at the end of the present turn, tool out first."""


class Retract(Command):
    """Take the tool out of the part, after a stop."""


class Recover(Command):
    """Reset after a stop that the operator has seen. Nothing moves."""


class TakeControl(Command):
    """Take control from the console that has it, at rest. Nothing moves."""


@dataclass(frozen=True, kw_only=True)
class TakeTrace(Command):
    """Judge a part by the trace in a file: the part in the chuck, or else the newest of this job in the record.

    `answers` are for the header keys that the file does not state, `sha256` is of the file as the operator saw it.
    """

    path: Path
    sha256: str
    job: Job
    loaded: LoadedJob | None
    answers: Mapping[str, str]


class CorrectTouchOff(Command):
    """Correct the touch-off by the diameter of the last measured part, once. Nothing moves."""


class Measure(Command):
    """Release the part and take its roundness trace (the simulated gauge)."""


@dataclass(frozen=True, kw_only=True)
class Acknowledge(Command):
    """Acknowledge the alarms that are `shown`; with none, the foremost. The next one takes its place."""

    shown: tuple[Problem, ...] = ()


class Control(Protocol):
    """Interface from the operator's keys to the machine. Everything here returns at once, from any thread."""

    @property
    def state(self) -> StationState:
        """The newest state."""

    @property
    def side(self) -> SideLine | None:
        """Where worker threads ask the controller, between two polls; None where there is no controller."""

    def now_s(self) -> float:
        """Return machine time, to compute the age of the state."""

    def post(self, intent: Command) -> bool:
        """Post a command. False when the machine is busy: a command is refused then, never queued."""

    def stop(self, reason: str) -> None:
        """Stop the machine now, bypassing everything that waits."""

    def kill(self, reason: str) -> None:
        """Open every loop now; the spindle coasts."""

    def beat(self) -> None:
        """Signal that the screen is alive; without it, a moving machine is stopped."""
