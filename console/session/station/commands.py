"""Operator commands as values, and the interface that takes them. Stop and kill have a path of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Protocol

from drivers.cutting.bounds import Adjustable
from drivers.lathe.snapshot import AxisName

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from console.session.data.identified_responses import ChosenResponse
    from console.session.station.state import StationState
    from drivers.cutting.strategy import Strategy
    from drivers.requests.side_line import SideLine
    from profiles.compensations.learned_compensation import LearnedCompensation
    from profiles.fingerprint.readings import ClampReadings
    from profiles.job import Job
    from profiles.problem import Problem
    from profiles.store import LoadedJob


LEAST_ARMED_S, MOST_ARMED_S = 10.0, 90.0
"""How long after arming a cut may be started, s: as long as its summary takes to read."""


@dataclass(frozen=True)
class Command:
    """One command; those without fields differ by their class alone.

    `logged` is whether the log of the session has it: all that an operator orders.
    """

    logged: ClassVar[bool] = True


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


@dataclass(frozen=True, kw_only=True)
class NoteJog(Command):
    """Note whether the jog keys of this screen are enabled, for the guide and the feed. Nothing moves."""

    logged: ClassVar[bool] = False
    enabled: bool


@dataclass(frozen=True, kw_only=True)
class GoTo(Command):
    """Go to a typed target with one jog: Z, mm from its zero, or C, degrees from the index the shorter way."""

    axis: AxisName
    target: float


class TakeFlank(Command):
    """Record the present spindle angle as that of a flank of jaw 1 at the indicator."""


@dataclass(frozen=True, kw_only=True)
class TakeJaw(Command):
    """Record the angle at which jaw 1 meets the mark: by its flanks where there are readings, else the present.

    Readings with a larger spread than `most_spread_deg` are refused; None for no limit.
    """

    most_spread_deg: float | None = None


class NoteSkim(Command):
    """Record the present position of the tool as that of a skim cut, whose diameter is to be measured."""


@dataclass(frozen=True, kw_only=True)
class TakeTouchOff(Command):
    """Record that the tool tip is at this radius: at its present position, or where it made the skim cut."""

    radius_mm: float
    skimmed: bool = False


class ReadLoop(Command):
    """Read the gains of the tool and the servo period from the controller. Nothing moves."""


@dataclass(frozen=True, kw_only=True)
class ApplyGains(Command):
    """Write these gains of the tool on trial, drives disabled; `shown` was shown as present. Nothing moves."""

    settings: tuple[tuple[str, float], ...]
    shown: tuple[tuple[str, float], ...]


class RevertGains(Command):
    """Write back the gains there were before the trial, drives disabled. Nothing moves."""


@dataclass(frozen=True, kw_only=True)
class CheckHealth(Command):
    """Move the tool by a step, a parabola and a sine at its zero, and keep what was gathered."""

    step_um: float


@dataclass(frozen=True, kw_only=True)
class IdentifyTool(Command):
    """Swing the tool at its zero at some frequencies, and keep the response of this path."""

    path: Strategy


class Forget(Command):
    """Forget the newest reading: a flank, a skim cut, the touch-off, or jaw 1 where there is none of them."""


@dataclass(frozen=True, kw_only=True)
class Arm(Command):
    """Plan, load, read back and check a cut; start is allowed for `valid_s` seconds after it.

    `loaded` is the file that the job is from, None if it differs from it: then nothing was learned of it.
    `compensation` is what was learned of it, None the model's; `stage` is a `console.session.stages.Stage`.
    `inverts` is the identified response that a cut without anything learned inverts, None the model's.
    """

    job: Job
    job_sha256: str
    strategy: Strategy
    loaded: LoadedJob | None = None
    compensation: LearnedCompensation | None = None
    stage: str = "full"
    valid_s: float = LEAST_ARMED_S
    inverts: ChosenResponse | None = None


class Disarm(Command):
    """Disarm the cut."""


class Start(Command):
    """Go to the start position and run the armed cut."""


class EndCut(Command):
    """End the cut at the end of the present turn, tool out first."""


class HoldFeed(Command):
    """Hold the cut at the end of the present turn: the tool goes out, the spindle turns on."""


@dataclass(frozen=True, kw_only=True)
class ResumeFeed(Command):
    """Bring the tool of a held cut in again, at the same angle and place; with `one_turn` for one turn."""

    one_turn: bool = False


@dataclass(frozen=True, kw_only=True)
class Adjust(Command):
    """Change a running cut by some steps: the override of spindle and feed, or a trim of its compensation."""

    what: Adjustable
    steps: int


@dataclass(frozen=True, kw_only=True)
class InjectFault(Command):
    """Give the simulated lathe a fault: `inject NAME [KEY=VALUE ...]`, or `clear`."""

    line: str
    logged: ClassVar[bool] = False  # a trainee has to find it


@dataclass(frozen=True, kw_only=True)
class Indicate(Command):
    """Read the indicator on the clamped part of the simulated lathe at so many places, from jaw 1 on."""

    logged: ClassVar[bool] = False
    places: int


@dataclass(frozen=True, kw_only=True)
class TakeFingerprint(Command):
    """Record the readings of an indicator on the clamped blank of this job, None to drop them. Nothing moves."""

    job: Job
    readings: ClampReadings | None


class AskTruth(Command):
    """Ask the simulated lathe for its true state when a lesson is over."""

    logged: ClassVar[bool] = False


class Retract(Command):
    """Take the tool out of the part, after a stop."""


class ClearTables(Command):
    """Clear what a table that was left on adds to the tool, without a home and with the drives killed.

    Nothing moves.
    """


class Recover(Command):
    """Reset after a stop that the operator has seen. Nothing moves."""


class TakeControl(Command):
    """Take control from the console that has it, at rest. Nothing moves."""


@dataclass(frozen=True, kw_only=True)
class TakeTrace(Command):
    """Judge a part by the trace in a file: the part in the chuck, or else the newest of this job in the record.

    `answers` are for the header keys that the file does not state, `sha256` is of the content as the operator saw
    it. `others` are further files, each with sections of the same part.
    """

    path: Path
    sha256: str
    job: Job
    loaded: LoadedJob | None
    answers: Mapping[str, str]
    others: tuple[Path, ...] = ()


class CorrectTouchOff(Command):
    """Correct the touch-off by the diameter of the last measured part, once. Nothing moves."""


class Measure(Command):
    """Release the part and take its roundness trace (the simulated gauge)."""


@dataclass(frozen=True, kw_only=True)
class MeasureTurned(Command):
    """Take the error of the gauge off the last part, which was measured again, turned on the gauge.

    `second` is the file of that, None on the simulated gauge, which measures it now.
    """

    second: TakeTrace | None = None


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
        """Where worker threads ask the controller, between two polls; None if there is no controller."""

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
