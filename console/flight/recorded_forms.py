"""What is recorded in the place of values that are too large: a plan, a learning step, the work."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from console.session.station.state import StationState
from console.session.work import Work
from profiles.job import Job
from profiles.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Mapping

NOT_RECORDED = Problem(code="flight.learning_left_out")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedPlan:
    """What the pages show of an armed plan; its program is not recorded. Units as in `CutPlan`."""

    spindle_speed_rpm: float
    carriage_start: float
    tool_start: float
    duration_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedWork:
    """The open job: as it is, as its file has it, and how it would be cut. What was learned of it is left out."""

    job: Job
    saved: Job
    path: str
    sha256: str
    strategy: str
    stage: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedMoment:
    """What is recorded of one moment: the machine, the page in front of the operator, and the open job.

    `said` are the answers to the last key.
    """

    state: StationState
    page: str = ""
    work: RecordedWork | None = None
    said: tuple[Problem, ...] = ()


def to_recorded_form(value: object) -> Any:
    """Return what is recorded in the place of a value."""
    form = _FORMS.get(type(value).__name__)
    return value if form is None else form(value)


def work_of(work: Work | None) -> RecordedWork | None:
    """Return what is recorded of the open job."""
    if work is None:
        return None
    return RecordedWork(
        job=work.job,
        saved=work.loaded.job,
        path=str(work.loaded.path),
        sha256=work.loaded.sha256,
        strategy=work.strategy,
        stage=work.stage,
    )


def _plan(plan: Any) -> RecordedPlan:
    names = ("spindle_speed_rpm", "carriage_start", "tool_start", "duration_s")
    return RecordedPlan(**{name: getattr(plan, name) for name in names})


def _learning(learning: Any) -> Any:
    faults = type(learning.faults)()
    if learning.taught is None:
        return replace(learning, faults=faults)
    return replace(learning, taught=None, problems=(NOT_RECORDED,), faults=faults)


def _lobe(lobe: Any) -> Any:
    return lobe if lobe.found is None else replace(lobe, found=None, problems=(NOT_RECORDED,))


_FORMS = {"CutPlan": _plan, "PartLearning": _learning, "PartLobe": _lobe}
"""By the names of their types: nothing heavy is imported for a recording."""


@cache
def names() -> Mapping[str, Any]:
    """Return the types that the state names without importing them (`TYPE_CHECKING`); they are for reading."""
    from console.session.data.measured_part import MadeWith
    from console.session.force_record import ForceCheck
    from console.session.learning.calibrating import PartLobe
    from console.session.learning.part_learning import PartLearning
    from console.session.station.link.lost_link import LostLink
    from console.session.station.progress import CutProgress
    from console.session.tuning.standing_trial import StandingTrial
    from drivers.cutting.strategy import Strategy
    from drivers.identification.tool_gains import ToolLoop
    from drivers.simulator.plant.workshop_view import Dials, Truth, WorkshopView
    from profiles.fingerprint.readings import ClampReadings
    from profiles.metrology.cylindricity import CylinderResult, PartSection
    from profiles.metrology.uncertainty import UncertaintyBudget
    from profiles.roundness import RoundnessResult
    from profiles.store import LoadedJob
    from profiles.traces import Trace

    found = (
        MadeWith,
        ForceCheck,
        PartLearning,
        PartLobe,
        CutProgress,
        Strategy,
        Job,
        CylinderResult,
        PartSection,
        UncertaintyBudget,
        RoundnessResult,
        LoadedJob,
        Trace,
        ToolLoop,
        StandingTrial,
        LostLink,
        WorkshopView,
        Dials,
        Truth,
        ClampReadings,
    )
    return {**{each.__name__: each for each in found}, "CutPlan": RecordedPlan}
