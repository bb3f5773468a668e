"""What must be known before tool and lobe are in phase, and why it is not known any more.

Four stamps with lives of their own: home (encoder power), jaw 1 (the mounting of the chuck), touch-off (the
tool), clamping (every opening of the chuck). Pure: the station keeps the value and tells it what happened.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import Severity, force_as_measured, same_force


class AlignStep(StrEnum):
    """The steps in the order in which they are done: hands are in the chuck before the drives are on."""

    VERIFY = "verify"
    CLAMP = "clamp"
    DRIVES = "drives"
    HOME = "home"
    JAW = "jaw"
    TOUCH_OFF = "touch_off"


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamping:
    """A blank was clamped: with which total force, for which part, and when (local time, text)."""

    force_n: float
    diameter_mm: float
    overhang_mm: float
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JawAngle:
    """The spindle angle at which jaw 1 meets the mark, degrees from the index in [0, 360)."""

    angle_deg: float
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchOff:
    """The radius of the tool tip at motor position zero, as it was found on a surface of known radius."""

    zero_radius_mm: float
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """What is known of the set-up. `settings` is None until the controller was compared with its profile.

    `lost` says of a stamp why and when it went.
    """

    settings: tuple[Problem, ...] | None = None
    drives_on: bool = False
    homed: bool = False
    clamping: Clamping | None = None
    jaw: JawAngle | None = None
    touch_off: TouchOff | None = None
    lost: tuple[Problem, ...] = ()


def observed(alignment: Alignment, *, drives_on: bool, homed: bool, at: str) -> Alignment:
    """Return the alignment after a look at the machine. Without its home, jaw 1 and the touch-off mean nothing."""
    if alignment.drives_on == drives_on and alignment.homed == homed:
        return alignment
    after = replace(alignment, drives_on=drives_on, homed=homed)
    if alignment.homed and not homed and (alignment.jaw or alignment.touch_off):
        return replace(after, jaw=None, touch_off=None, lost=(Problem(code="alignment.home_lost", value=at),))
    return after


def unclamped(alignment: Alignment, at: str) -> Alignment:
    """Return the alignment after the chuck was opened."""
    if alignment.clamping is None:
        return alignment
    return replace(alignment, clamping=None, lost=(Problem(code="alignment.unclamped", value=at),))


def step_problems(alignment: Alignment, step: AlignStep, job: Job) -> tuple[Problem, ...]:
    """Return why a step is not done for this job; empty when it is."""
    return _JUDGES[step](alignment, job)


def problems(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    """Return every reason why the alignment is not valid for this job."""
    return tuple(problem for step in AlignStep for problem in step_problems(alignment, step, job))


def current_step(alignment: Alignment, job: Job) -> AlignStep | None:
    """Return the first step that is not done, None when all are."""
    return next((step for step in AlignStep if step_problems(alignment, step, job)), None)


def force_problems(job: Job) -> tuple[Problem, ...]:
    """Return why this job's chucking force is not the one at which its lobe error was found."""
    finding = force_as_measured(job)
    return () if finding.severity is Severity.OK else (finding.problem,)


def aligned_job(job: Job, alignment: Alignment) -> Job:
    """Return the job with jaw 1 where it was found, or as its file assumes it; the lobe stays as far past it."""
    if alignment.jaw is None:
        return job
    return replace(job, lobe_phase_deg=(alignment.jaw.angle_deg + (job.lobe_past_jaw_deg or 0.0)) % 360.0)


def aligned_machine(machine: MachineProfile, alignment: Alignment) -> MachineProfile:
    """Return the machine with the tool tip where the touch-off found it, or as its profile says."""
    if alignment.touch_off is None:
        return machine
    tool = replace(machine.tool, home_radius_mm=alignment.touch_off.zero_radius_mm)
    return replace(machine, tool=tool)


def _verify(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return (Problem(code="alignment.not_verified"),) if alignment.settings is None else alignment.settings


def _clamp(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    clamping = alignment.clamping
    if clamping is None:
        return (
            *_lost(alignment, "alignment.unclamped"),
            Problem(code="alignment.no_clamping"),
            *force_problems(job),
        )
    if not same_force(clamping.force_n, job.chucking_force_n):
        value, limit = f"{clamping.force_n:g} N", f"{job.chucking_force_n:g} N"
        return (Problem(code="alignment.clamped_otherwise", key="chucking_force_n", value=value, limit=limit),)
    for key in ("diameter_mm", "overhang_mm"):
        clamped, wanted = getattr(clamping, key), getattr(job, key)
        if clamped != wanted:
            value, limit = f"{clamped:g} mm", f"{wanted:g} mm"
            return (Problem(code="alignment.clamped_otherwise", key=key, value=value, limit=limit),)
    return force_problems(job)


def _drives(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return () if alignment.drives_on else (Problem(code="alignment.drives_off"),)


def _home(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return (
        () if alignment.homed else (*_lost(alignment, "alignment.home_lost"), Problem(code="alignment.not_homed"))
    )


def _jaw(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return () if alignment.jaw is not None else (Problem(code="alignment.no_jaw"),)


def _touch_off(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return () if alignment.touch_off is not None else (Problem(code="alignment.no_touch_off"),)


def _lost(alignment: Alignment, code: str) -> tuple[Problem, ...]:
    return tuple(problem for problem in alignment.lost if problem.code == code)


_JUDGES: dict[AlignStep, Callable[[Alignment, Job], tuple[Problem, ...]]] = {
    AlignStep.VERIFY: _verify,
    AlignStep.CLAMP: _clamp,
    AlignStep.DRIVES: _drives,
    AlignStep.HOME: _home,
    AlignStep.JAW: _jaw,
    AlignStep.TOUCH_OFF: _touch_off,
}
