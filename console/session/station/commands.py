"""Operator commands as values. Stop and kill are not here: they have a path of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.lathe.snapshot import AxisName

if TYPE_CHECKING:
    from drivers.cutting.strategy import Strategy
    from profiles.compensations.learned import LearnedCompensation
    from profiles.job import Job
    from profiles.problem import Problem
    from profiles.store import LoadedJob


@dataclass(frozen=True, slots=True, kw_only=True)
class Verify:
    """Compare the controller's settings with the machine profile again. Nothing moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfirmClamping:
    """The blank of this job is clamped with its chucking force. Drives must be off: somebody was inside."""

    job: Job


@dataclass(frozen=True, slots=True, kw_only=True)
class EnableDrives:
    """Close the loops of all axes at their present positions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DisableDrives:
    """Open all loops, at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Home:
    """Home each axis: tool outwards first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """Bring the tool over the part, clear of it by the machine's retract distance: for the touch-off."""

    job: Job


@dataclass(frozen=True, slots=True, kw_only=True)
class Jog:
    """One step of one axis: mm towards the work or the chuck, degrees in the direction of the cut; signed."""

    axis: AxisName
    distance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeJaw:
    """Record the present spindle angle as the one at which jaw 1 meets the mark."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeTouchOff:
    """Record that the tool tip touches a surface of this radius at its present position."""

    radius_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Forget:
    """Forget the touch-off, or jaw 1 where there is none, to take it again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Disarm:
    """Disarm the cut."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Go to the start position and run the armed cut."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndCut:
    """End the cut at the end of the present turn, tool out first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Retract:
    """Take the tool out of the part, after a stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recover:
    """Reset after a stop that the operator has seen. Nothing moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeControl:
    """Take control from the console that has it, at rest. Nothing moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """Release the part and take its roundness trace (the simulated gauge)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledge:
    """Acknowledge the alarms that are `shown`; with none, the foremost. The next one takes its place."""

    shown: tuple[Problem, ...] = ()


Command = (
    Verify
    | ConfirmClamping
    | EnableDrives
    | DisableDrives
    | Home
    | Approach
    | Jog
    | TakeJaw
    | TakeTouchOff
    | Forget
    | Arm
    | Disarm
    | Start
    | EndCut
    | Retract
    | Recover
    | TakeControl
    | Measure
    | Acknowledge
)
