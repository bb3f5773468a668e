"""What must be known before tool and lobe are in phase, and why it is not known any more.

Four stamps with lives of their own. Each keeps what it rests on, and holds for that alone:

- home: the power of the encoders, and the index. Without it the next two mean nothing.
- jaw 1: the machine and its chuck, and the number of jaws: another one is another mounting.
- touch-off: the machine and its tool, and the diameter of the blank that it was taken on. The tip does not move
  with the diameter, but a touch is off by the lobe of that very blank, and by the scale of the way to another
  surface: the tool is touched off where it is to cut.
- clamping: each opening of the chuck; force, jaws, and the blank: material, diameter, wall, overhang.

Once another console has controlled the machine none of the last three is known: that one may have changed
anything. Pure: the station keeps the value and tells it what happened.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from profiles.findings import Severity
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import force_as_measured, same_force


class AlignStep(StrEnum):
    """The steps in the order in which they are done: hands are in the chuck before the drives are on."""

    VERIFY = "verify"
    CLAMP = "clamp"
    DRIVES = "drives"
    HOME = "home"
    JAW = "jaw"
    TOUCH_OFF = "touch_off"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounted:
    """What is on the machine, by the names of its profile; "" where that gives none."""

    machine: str = ""
    chuck: str = ""
    tool: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamping:
    """A blank was clamped: with which total force and how many jaws, which blank, and when (local time, text)."""

    force_n: float
    jaws: int
    material: str
    diameter_mm: float
    wall_thickness_mm: float
    overhang_mm: float
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JawAngle:
    """The spindle angle at which jaw 1 meets the mark, degrees from the index in [0, 360), of so many jaws."""

    angle_deg: float
    jaws: int
    at: str
    on: Mounted = Mounted()


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchOff:
    """The radius of the tool tip at motor position zero, as it was found on a surface of this diameter."""

    zero_radius_mm: float
    diameter_mm: float
    at: str
    on: Mounted = Mounted()


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """What is known of the set-up. `settings` is None until the controller was compared with its profile.

    `on` is what is on the machine now. `lost` says of stamps why and when they went.
    """

    settings: tuple[Problem, ...] | None = None
    drives_on: bool = False
    homed: bool = False
    clamping: Clamping | None = None
    jaw: JawAngle | None = None
    touch_off: TouchOff | None = None
    lost: tuple[Problem, ...] = ()
    on: Mounted = Mounted()


def mounted_on(machine: MachineProfile) -> Mounted:
    """Return what is on a machine by its profile."""
    return Mounted(machine=machine.name, chuck=machine.chuck.name, tool=machine.tool.name)


def clamping_of(job: Job, at: str) -> Clamping:
    """Return the stamp of a blank that is clamped as its job says."""
    return Clamping(force_n=job.chucking_force_n, at=at, **{key: getattr(job, key) for key, _ in _BLANK})


def observed(
    alignment: Alignment, *, drives_on: bool, homed: bool, at: str, chuck_open: bool = False
) -> Alignment:
    """Return the alignment after a look at the machine. Without its home, jaw 1 and the touch-off mean nothing.

    `chuck_open` is what the controller sees of the chuck, where it sees it.
    """
    if chuck_open:
        alignment = unclamped(alignment, at)
    if alignment.drives_on == drives_on and alignment.homed == homed:
        return alignment
    after = replace(alignment, drives_on=drives_on, homed=homed)
    if homed:
        return _settled(after, "alignment.home_lost")
    if alignment.homed and not homed and (alignment.jaw or alignment.touch_off):
        return _without(replace(after, jaw=None, touch_off=None), Problem(code="alignment.home_lost", value=at))
    return after


def unclamped(alignment: Alignment, at: str) -> Alignment:
    """Return the alignment after the chuck was opened."""
    if alignment.clamping is None:
        return alignment
    return _without(replace(alignment, clamping=None), Problem(code="alignment.unclamped", value=at))


def clamped(alignment: Alignment, job: Job, at: str) -> Alignment:
    """Return the alignment with the blank of a job; in other jaws than before, jaw 1 has to be found anew."""
    fresh = replace(alignment, clamping=clamping_of(job, at))
    fresh = _settled(fresh, "alignment.unclamped", "alignment.handed_over")
    if alignment.jaw is None or alignment.jaw.jaws == job.jaws:
        return fresh
    return _without(replace(fresh, jaw=None), Problem(code="alignment.jaws_changed", value=at))


def jaw_found(alignment: Alignment, angle_deg: float, jaws: int, at: str) -> Alignment:
    """Return the alignment with jaw 1 of so many jaws at an angle from the index."""
    stamp = JawAngle(angle_deg=angle_deg % 360.0, jaws=jaws, at=at, on=alignment.on)
    return _settled(replace(alignment, jaw=stamp), "alignment.jaws_changed")


def handed_over(alignment: Alignment, at: str) -> Alignment:
    """Return the alignment after another console has controlled the machine."""
    if alignment.clamping is None and alignment.jaw is None and alignment.touch_off is None:
        return alignment
    gone = replace(alignment, clamping=None, jaw=None, touch_off=None, lost=())
    return _without(gone, Problem(code="alignment.handed_over", value=at))


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
    """Return the job with jaw 1 where it was found, or as its file assumes it; the lobe stays as far past it.

    Jaw 1 of another mounting says nothing of this job.
    """
    if alignment.jaw is None or _jaw(alignment, job):
        return job
    return replace(job, lobe_phase_deg=(alignment.jaw.angle_deg + (job.lobe_past_jaw_deg or 0.0)) % 360.0)


def aligned_machine(machine: MachineProfile, alignment: Alignment) -> MachineProfile:
    """Return the machine with the tool tip where the touch-off found it, or as its profile says.

    The tip is where it is, whatever is clamped: only another tool or machine takes that away.
    """
    if alignment.touch_off is None or _mounted_otherwise(alignment, alignment.touch_off.on, "machine", "tool"):
        return machine
    tool = replace(machine.tool, home_radius_mm=alignment.touch_off.zero_radius_mm)
    return replace(machine, tool=tool)


def _verify(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return (Problem(code="alignment.not_verified"),) if alignment.settings is None else alignment.settings


def _clamp(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    clamping = alignment.clamping
    if clamping is None:
        return (
            *_lost(alignment, "alignment.unclamped", "alignment.handed_over"),
            Problem(code="alignment.no_clamping"),
            *force_problems(job),
        )
    if not same_force(clamping.force_n, job.chucking_force_n):
        value, limit = f"{clamping.force_n:g} N", f"{job.chucking_force_n:g} N"
        return (Problem(code="alignment.clamped_otherwise", key="chucking_force_n", value=value, limit=limit),)
    for key, unit in _BLANK:
        stamped, target = getattr(clamping, key), getattr(job, key)
        if stamped != target:
            value, limit = (f"{each:g} {unit}" if unit else str(each) for each in (stamped, target))
            return (Problem(code="alignment.clamped_otherwise", key=key, value=value, limit=limit),)
    return force_problems(job)


def _drives(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return () if alignment.drives_on else (Problem(code="alignment.drives_off"),)


def _home(alignment: Alignment, _: Job) -> tuple[Problem, ...]:
    return (
        () if alignment.homed else (*_lost(alignment, "alignment.home_lost"), Problem(code="alignment.not_homed"))
    )


def _jaw(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    jaw = alignment.jaw
    if jaw is None:
        return (*_lost(alignment, "alignment.jaws_changed"), Problem(code="alignment.no_jaw"))
    if jaw.jaws != job.jaws:
        return (Problem(code="alignment.jaw_of_others", key="jaws", value=str(jaw.jaws), limit=str(job.jaws)),)
    return _mounted_otherwise(alignment, jaw.on, "machine", "chuck")


def _touch_off(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    touched = alignment.touch_off
    if touched is None:
        return (Problem(code="alignment.no_touch_off"),)
    if touched.diameter_mm != job.diameter_mm:
        value, limit = f"D {touched.diameter_mm:.3f} mm", f"D {job.diameter_mm:.3f} mm"
        return (Problem(code="alignment.touched_otherwise", key="diameter_mm", value=value, limit=limit),)
    return _mounted_otherwise(alignment, touched.on, "machine", "tool")


def _mounted_otherwise(alignment: Alignment, stamped: Mounted, *names: str) -> tuple[Problem, ...]:
    pairs = ((name, getattr(stamped, name), getattr(alignment.on, name)) for name in names)
    return tuple(
        Problem(code="alignment.mounted_otherwise", key=f"{name}.name", value=f'"{then}"', limit=f'"{now}"')
        for name, then, now in pairs
        if then != now
    )


def _without(alignment: Alignment, why: Problem) -> Alignment:
    """Return the alignment with one more reason why a stamp went, the newest of its kind."""
    return replace(alignment, lost=(*_settled(alignment, why.code).lost, why))


def _settled(alignment: Alignment, *codes: str) -> Alignment:
    """Return the alignment without these reasons: what they took is there again."""
    return replace(alignment, lost=tuple(each for each in alignment.lost if each.code not in codes))


def _lost(alignment: Alignment, *codes: str) -> tuple[Problem, ...]:
    return tuple(problem for problem in alignment.lost if problem.code in codes)


_BLANK = (
    ("jaws", ""),
    ("material", ""),
    ("diameter_mm", "mm"),
    ("wall_thickness_mm", "mm"),
    ("overhang_mm", "mm"),
)
"""What a clamping is for besides its force, and the units."""

_JUDGES: dict[AlignStep, Callable[[Alignment, Job], tuple[Problem, ...]]] = {
    AlignStep.VERIFY: _verify,
    AlignStep.CLAMP: _clamp,
    AlignStep.DRIVES: _drives,
    AlignStep.HOME: _home,
    AlignStep.JAW: _jaw,
    AlignStep.TOUCH_OFF: _touch_off,
}
