"""What the operator can ask of the machine, as values. Stop and kill are not here: they have their own way."""

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
    """The blank of this job is clamped with the job's chucking force. Drives must be off: hands were inside."""

    job: Job


@dataclass(frozen=True, slots=True, kw_only=True)
class EnableDrives:
    """Close the loops of all axes where they stand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DisableDrives:
    """Open all loops, at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Home:
    """Search the zero of each axis: tool outwards first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """Bring the tool over the part, clear of it by the retract distance of the machine: for the touch-off."""

    job: Job


@dataclass(frozen=True, slots=True, kw_only=True)
class Jog:
    """One step of one axis: mm towards the work or the chuck, degrees in the direction of the cut; signed."""

    axis: AxisName
    distance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeJaw:
    """Jaw 1 meets the mark where the spindle stands now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeTouchOff:
    """The tool tip touches a surface of this radius where it stands now."""

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
    """Take the arming back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Go to the start position and run the cut that was armed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndCut:
    """End the cut at the end of the present turn, tool out first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Retract:
    """Take the tool out of the part, after a stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recover:
    """The operator has seen the stop and goes on. Nothing moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeControl:
    """Take the machine from the console that controls it, at rest. Nothing moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """Release the part and take its roundness trace (the simulated gauge)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledge:
    """The operator has seen the alarms that are `shown`, none: the foremost. The next one takes its place."""

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
