"""Everything that a screen may show of the machine, as one immutable value that is replaced, never changed.

Imports are light: the first page is painted from it before numerics and the link are there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from console.session.cut.alignment import Alignment
from console.session.station.alarms import Alarms
from drivers.cutting.bounds import UNCHANGEABLE, Bounds
from drivers.lathe.console_role import NOBODY, ConsoleRole, Signature
from drivers.lathe.snapshot import Snapshot
from profiles.metrology.conformity import JudgedFigure, ToleranceKind, figure_of, judge_part, passes_all
from profiles.problem import Problem
from profiles.trace_files.header import DIAMETER_STATED, size_doubt

if TYPE_CHECKING:
    from console.session.data.measured_part import MadeWith
    from console.session.force_record import ForceCheck
    from console.session.learning.calibrating import PartLobe
    from console.session.learning.part_learning import PartLearning
    from console.session.station.link.lost_link import LostLink
    from console.session.station.progress import CutProgress
    from console.session.tuning.standing_trial import StandingTrial
    from drivers.cutting.planning import CutPlan
    from drivers.cutting.strategy import Strategy
    from drivers.identification.tool_gains import ToolLoop
    from drivers.simulator.plant.workshop_view import Truth, WorkshopView
    from profiles.fingerprint.readings import ClampReadings
    from profiles.job import Job
    from profiles.metrology.cylindricity import CylinderResult, PartSection
    from profiles.metrology.uncertainty import UncertaintyBudget
    from profiles.roundness import RoundnessResult
    from profiles.store import LoadedJob
    from profiles.traces import Trace


class Activity(StrEnum):
    """Current activity of the link thread."""

    CONNECTING = "connecting"
    READY = "ready"
    VERIFYING = "verifying"
    WRITING = "writing"
    CLAMPING = "clamping"
    SWITCHING = "switching"
    HOMING = "homing"
    JOGGING = "jogging"
    APPROACHING = "approaching"
    POSITIONING = "positioning"
    ARMING = "arming"
    CUTTING = "cutting"
    RETRACTING = "retracting"
    MEASURING = "measuring"
    TESTING = "testing"
    STOPPING = "stopping"
    STOPPED = "stopped"
    LOST = "lost"


MOVING = frozenset(
    {
        Activity.HOMING,
        Activity.JOGGING,
        Activity.APPROACHING,
        Activity.POSITIONING,
        Activity.CUTTING,
        Activity.RETRACTING,
        Activity.TESTING,
        Activity.STOPPING,
    }
)
"""Activities in which something moves, or is about to."""

IDLE = frozenset({Activity.READY, Activity.STOPPED, Activity.LOST})
"""Activities in which the link thread accepts a command."""

PAUSED = "paused"  # of `CutStage`, which is not there for the first page

STALE_S = 1.0  # a state older than this is no longer current
STALE_IN_MOTION_S = 0.6
"""The same of a motion that was seen: it is polled every 50 ms, and a poll without a reply is repeated once."""

POLLED = MOVING - {Activity.TESTING, Activity.STOPPING}  # a test also reads what it has sampled


@dataclass(frozen=True, slots=True, kw_only=True)
class StopState:
    """A stop that was sent: why, when (machine time), as which character, and when rest was proven.

    `still_s` is the first poll from which on nothing has moved, None if none is known: the proof takes longer.
    `taken_s` is when a poll first showed that the controller obeys it. `delivered` is False when the link did not
    take it. `tool_in_part` is None while it is not known; `can_retract` is whether every loop is closed. `of_cut`
    is whether it ended a cut, `mark_mm` where the tool then came to rest in the part, mm behind its face; None
    where it did not.
    """

    reason: str
    killed: bool
    sent_s: float
    delivered: bool = True
    taken_s: float | None = None
    rest_s: float | None = None
    still_s: float | None = None
    tool_in_part: bool | None = None
    can_retract: bool = False
    of_cut: bool = False
    mark_mm: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmedCut:
    """A cut that may be started until `until_s` (machine time). `job` has jaw 1 where it was found.

    `alignment` is that of the arming. `made` is how the part will have been cut, `loaded` the file of
    the job, None if it was edited. `bounds` is by how much the cut may be changed while it runs, `warnings`
    what its fingerprint has against it.
    """

    job: Job
    strategy: Strategy
    plan: CutPlan
    alignment: Alignment
    until_s: float
    made: MadeWith
    loaded: LoadedJob | None = None
    bounds: Bounds = UNCHANGEABLE
    warnings: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredPart:
    """A part that was released and measured: its trace with jaw 1 at `jaw_1_deg`, and the result.

    `marks_mm` is where a stop left the tool in it, mm behind its face. `learning` is its learning step, `budget`
    the uncertainty of its figures, None without a gauge. Where not `phase_known`, nobody knows where jaw 1 is in
    the trace. `diameter_mm` is the mean one, `tool_offset_um` how much deeper the tool has to go for the nominal
    one; both are None if the trace does not have the size. `offset_taken`: the touch-off was corrected by it.
    `lobe` is that of a part cut without compensation. `run_id` is its run in the record, `whole` its form over the
    length and `sections` all of its sections in the job's Z, at the angles of `trace`, which is the one at
    `section_z_mm` (None: not stated). Where its cut is not `proven` to be the planned one, it is neither good nor
    bad.
    """

    job: Job
    strategy: Strategy
    trace: Trace
    result: RoundnessResult
    jaw_1_deg: float
    whole: CylinderResult | None = None
    sections: tuple[PartSection, ...] = ()
    section_z_mm: float | None = None
    phase_known: bool = True
    diameter_mm: float | None = None
    tool_offset_um: float | None = None
    offset_taken: bool = False
    marks_mm: tuple[float, ...] = ()
    budget: UncertaintyBudget | None = None
    learning: PartLearning | None = None
    lobe: PartLobe | None = None
    run_id: str | None = None
    proven: bool = True

    @property
    def size_doubt(self) -> Problem | None:
        """Why the size cannot be that of its job, and so says nothing of the tool offset; None if it may be."""
        return None if self.diameter_mm is None else size_doubt(self.diameter_mm / 2.0, self.job)

    @property
    def judged(self) -> tuple[JudgedFigure, ...]:
        """Its figures against the limits of its job; no diameter where one was stated as the radius."""
        return judge_part(
            self.job.tolerances,
            ront_um=self.result.ront_um,
            mean_um=self.result.mean_deviation_um,
            off_um=_off_um(self.diameter_mm, self.size_doubt, self.job),
            z_mm=self.section_z_mm,
            sections=() if self.whole is None else self.whole.sections,
            cylt_um=None if self.whole is None else self.whole.cylt_um,
            uncertainty=None if self.budget is None else self.budget.expanded,
        )

    @property
    def diameter_passes(self) -> bool | None:
        """Whether each mean diameter is within the tolerance of its job; None if it is not judged."""
        figure = figure_of(ToleranceKind.DIAMETER, self.judged)
        return None if figure is None else figure.passes

    @property
    def is_half(self) -> bool:
        """Whether it was cut with half of its compensation: it was not meant to be round."""
        return self.learning is not None and self.learning.made.stage == "partial"


def _off_um(diameter_mm: float | None, doubt: Problem | None, job: Job) -> float | None:
    """Return the oversize of a mean diameter; None without one, and where it was stated as the radius."""
    if diameter_mm is None or (doubt is not None and doubt.code == DIAMETER_STATED):
        return None
    return 1000.0 * (diameter_mm - job.finished_diameter_mm)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredForm:
    """A part measured in points that are no sections (a helix, a bird-cage): the `whole` is known, no roundness.

    `no_sections` says so: nothing is learned of it. `meta` are the header lines, `notes` what is doubtful.
    `diameter_mm` is that of the least squares cylinder, None if the points do not have the size.
    """

    job: Job
    made: MadeWith
    whole: CylinderResult
    meta: Mapping[str, str]
    no_sections: Problem
    notes: tuple[Problem, ...] = ()
    diameter_mm: float | None = None
    budget: UncertaintyBudget | None = None
    run_id: str | None = None
    proven: bool = True

    @property
    def judged(self) -> tuple[JudgedFigure, ...]:
        """Its figures against the limits of its job."""
        doubt = None if self.diameter_mm is None else size_doubt(self.diameter_mm / 2.0, self.job)
        return judge_part(
            self.job.tolerances,
            ront_um=None,
            mean_um=0.0,
            off_um=_off_um(self.diameter_mm, doubt, self.job),
            taper_um=self.whole.taper_um,
            cylt_um=self.whole.cylt_um,
            uncertainty=None if self.budget is None else self.budget.expanded,
        )

    @property
    def is_half(self) -> bool:
        """Whether it was cut with half of its compensation: it was not meant to be round."""
        return self.made.stage == "partial"

    @property
    def passes(self) -> bool | None:
        """Whether its figures pass; None of a half or not proven cut, and if nothing fails: RONt is not known."""
        return None if self.is_half or not self.proven else passes_all(self.judged)


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchedBlank:
    """Upper bound of how far the clamped blank is cut: to Z `to_mm` behind its face, by a cut of `of_mm`."""

    to_mm: float
    of_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StationState:
    """One moment. `at_s` is machine time.

    `cut_done` means that the clamped part has been cut to its end. `form` is in the place of `measured` where the
    last part was measured in points that are no sections. `uncompensated` is the last part, of whatever
    job, that was cut without compensation and measured. `refusals` answer the last command, and end with the
    next. `loading_until_s` is about when the program will have been loaded, machine time; None while none is.
    `spindle_rpm` is None until enough was sampled. `stops` counts those that were settled. `marks_mm` is where
    stops left the tool in the clamped part while it turned, mm behind its face. `touched` is how far it is cut,
    by however many cuts, None while no tool has been in it. `uncommissioned` is why this machine may not cut at
    all, as of the last time its settings were read. `standing` is this console's role at the machine, `holder`
    the number of the console that controls it, `held_by` who that is as far as it has said so, `onlookers` how
    many others of this data folder look on while this one controls. `lathe` is which simulated lathe it is, empty
    for a real machine. `jogs` counts the jogs that ended in position, `jog_enabled` is whether the jog keys of
    the screen move the machine now, `ends_s` is when the present motion should end (machine time), None where
    that is not known, `ends_at_most` whether it may end long before. `firmware` is the version and the type of
    the controller, `controller` both as text. `lost_link` is the loss of the link, until F2 after it is back.
    `tool_loop` is the loop of the tool as it was read last, `tested` the name of the file with the last test of
    the tool. `trial` are gains that were applied on trial, as the controller had them when it was compared last.
    `force` is what the force of the last half-stage cut says of sign and angle. `truth` is what is so at a
    simulated lathe, once it was asked; `indicated` what an indicator shows there of the clamping, likewise.
    `speed` is how many times as fast as real time that runs, 0 while its instructor has paused it; `stop_waits`
    is whether a stop was sent to it meanwhile.
    """

    activity: Activity = Activity.CONNECTING
    standing: ConsoleRole = ConsoleRole.OWNER
    holder: int = NOBODY
    held_by: Signature | None = None
    onlookers: int = 0
    simulated: bool = True
    lathe: str = ""
    machine: str = ""
    address: str = ""
    controller: str = ""
    firmware: tuple[str, str] = ("", "")
    at_s: float = 0.0
    round_trip_ms: float = 0.0
    snapshot: Snapshot | None = None
    spindle_rpm: float | None = None
    seen: WorkshopView | None = None
    alignment: Alignment = field(default_factory=Alignment)
    alarms: Alarms = ()
    refusals: tuple[Problem, ...] = ()
    stop: StopState | None = None
    stops: int = 0
    jogs: int = 0
    jog_enabled: bool = False
    ends_s: float | None = None
    ends_at_most: bool = False
    lost_link: LostLink | None = None
    loading_until_s: float | None = None
    armed: ArmedCut | None = None
    cut: CutProgress | None = None
    cut_done: bool = False
    touched: TouchedBlank | None = None
    marks_mm: tuple[float, ...] = ()
    uncommissioned: tuple[Problem, ...] = ()
    measured: MeasuredPart | None = None
    form: MeasuredForm | None = None
    uncompensated: MeasuredPart | None = None
    tool_loop: ToolLoop | None = None
    tested: str = ""
    trial: StandingTrial | None = None
    force: ForceCheck | None = None
    truth: Truth | None = None
    indicated: ClampReadings | None = None
    speed: float = 1.0
    stop_waits: bool = False

    @property
    def moving(self) -> bool:
        """Whether something moves or is about to, as far as known: for a lost machine this is False."""
        return self.activity is not Activity.LOST and self.may_move

    @property
    def cut_to(self) -> TouchedBlank | None:
        """How far the clamped blank is cut; a mark beyond the last poll of the cut shows how far the tool got."""
        if self.touched is None:
            return None
        return replace(self.touched, to_mm=max(self.touched.to_mm, *self.marks_mm, 0.0))

    @property
    def seen_moving(self) -> bool:
        """Whether something moved in the last poll, whoever moves it."""
        return self.moving or (self.snapshot is not None and self.snapshot.moving)

    @property
    def paused(self) -> bool:
        """Whether a cut is held now, with its tool out, so that it can be resumed."""
        cut = self.cut if self.activity is Activity.CUTTING else None
        return cut is not None and cut.stage == PAUSED and not cut.holding

    @property
    def controls(self) -> bool:
        """Whether this console controls the machine; another one may be why it moves."""
        return self.standing is ConsoleRole.OWNER

    @property
    def may_move(self) -> bool:
        """Whether a motion of ours is active, or must be assumed: a machine that was lost in motion."""
        moves = self.activity in MOVING or (self.snapshot is not None and not self.snapshot.at_rest)
        return self.controls and moves

    def age_s(self, now_s: float) -> float | None:
        """Return the greatest age of any value that was read; None if none was."""
        return None if self.snapshot is None else self.snapshot.age_s(now_s)

    def is_stale(self, now_s: float) -> bool:
        """Whether the state shown is too old, or will not be refreshed."""
        age_s, limit_s = self.age_s(now_s), STALE_IN_MOTION_S if self._is_seen_moving else STALE_S
        return self.activity is Activity.LOST or age_s is None or age_s > limit_s

    def is_unanswered(self, now_s: float) -> bool:
        """Whether something was seen moving, or is being stopped, and nobody has told since what it does."""
        stopping = self.activity is Activity.STOPPING and self.stop is not None and self.stop.rest_s is None
        seen = stopping or self._is_seen_moving
        return self.controls and seen and self.snapshot is not None and self.is_stale(now_s)

    @property
    def _is_seen_moving(self) -> bool:
        return self.activity in POLLED and self.snapshot is not None and self.snapshot.moving


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionStart:
    """The stamps of an `alignment` (clamping, jaw 1, touch-off) with which a session begins; its drives.

    A simulated lathe is taken over in the middle of somebody's work: what was known there is known here.
    """

    alignment: Alignment
    drives_on: bool
