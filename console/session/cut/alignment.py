"""Alignment of tool and lobe: what must be known for it, and why it was lost.

Four stamps with separate lifetimes, each valid only for what it was taken on:

- home: encoder power, and the index. Without it the next two mean nothing.
- jaw 1: the machine, its chuck, and the number of jaws: a change of these is a new mounting.
- touch-off: the machine and its tool, and the diameter of the blank that it was taken on. The tip does not move
  with the diameter, but a touch is off by the lobe of that very blank, and by the scale error over the distance
  to another surface: touch off where the tool is to cut.
- clamping: one closing of the chuck, with force, jaws, and the blank: material, diameter, wall, overhang.

Once another console has had control, the last three are lost: it may have changed anything.
Pure: the station keeps the value and reports events to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

from profiles.chucking.holding import force_as_measured, same_force
from profiles.findings import Severity
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.same_objects import SameObjects

_BLANK = {"jaws": "", "material": "", "diameter_mm": "mm", "wall_thickness_mm": "mm", "overhang_mm": "mm"}
"""Properties of a clamping besides its force, with their units."""

ENDED_EARLY = "alignment.ended_early"  # the last cut on this machine, as its record says: the part may be cut

HANDED_OVER = "alignment.handed_over"
NOT_KEPT = "alignment.not_kept"  # nobody has control any more: who had it meanwhile is not known


class AlignStep(StrEnum):
    """Alignment steps in order: clamping, with somebody inside the guard, comes before the drives are on."""

    VERIFY = "verify"
    CLAMP = "clamp"
    DRIVES = "drives"
    HOME = "home"
    JAW = "jaw"
    TOUCH_OFF = "touch_off"


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedEquipment:
    """Tool, chuck and machine now mounted, by the names in the profile; "" where it gives none."""

    machine: str = ""
    chuck: str = ""
    tool: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamping:
    """Clamping of a blank: total force, number of jaws, the blank, and when (local time, text)."""

    force_n: float
    jaws: int
    material: str
    diameter_mm: float
    wall_thickness_mm: float
    overhang_mm: float
    at: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JawAngle:
    """Spindle angle at which jaw 1 meets the mark, degrees from the index in [0, 360), for this number of jaws.

    `spread_deg` is that of the results of an indicator, the uncertainty of the angle; None if taken by eye.
    """

    angle_deg: float
    jaws: int
    at: str
    on: MountedEquipment = MountedEquipment()
    spread_deg: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchOff:
    """Radius of the tool tip at motor position zero, as found on a surface of this diameter.

    `skimmed`: by the micrometer on a skim cut, not by touching the surface of the blank.
    """

    zero_radius_mm: float
    diameter_mm: float
    at: str
    on: MountedEquipment = MountedEquipment()
    skimmed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Known set-up of the machine. `settings` is None until the controller was compared with its profile.

    `flanks` are readings for jaw 1 that are not taken yet, degrees from the index; `skim_counts` is where the tool
    made a skim cut that is to be measured. Both mean nothing without home. `on` is what is mounted now. `lost`
    records why and when stamps became invalid. `readings` are those of an indicator on this clamping, which need
    not be taken; another clamping loses them. `tables` is what a cut by a table has left on: until it is off
    nothing but the retract moves, and no clamping is confirmed.
    """

    settings: tuple[Problem, ...] | None = None
    drives_on: bool = False
    homed: bool = False
    clamping: Clamping | None = None
    jaw: JawAngle | None = None
    touch_off: TouchOff | None = None
    flanks: tuple[float, ...] = ()
    skim_counts: float | None = None
    lost: tuple[Problem, ...] = ()
    on: MountedEquipment = MountedEquipment()
    readings: ClampReadings | None = None
    tables: tuple[Problem, ...] = ()


NO_HOME_FOR_TABLE = "cut.table_no_home"


def table_problems(alignment: Alignment) -> tuple[Problem, ...]:
    """Return what tables that were left on keep from being done, with the way out that there is.

    Without a home nobody knows where a table adds nothing: what it adds is cleared with the drives killed.
    """
    return tables_told(alignment.tables, homed=alignment.homed)


def tables_told(tables: tuple[Problem, ...], *, homed: bool) -> tuple[Problem, ...]:
    """Return the same of what was just read of the `tables`, and of axes that are `homed` or not."""
    held = held_by(tables)
    return tables if homed or not held else (replace(held[0], code=NO_HOME_FOR_TABLE),)


def held_by(tables: tuple[Problem, ...]) -> tuple[Problem, ...]:
    """Return those of the tables that add something to the tool, and are not only switched on."""
    return tuple(each for each in tables if each.code == "cut.table_holds")


def mounted_on(machine: MachineProfile) -> MountedEquipment:
    """Return the tool and chuck mounted on a machine according to its profile."""
    return MountedEquipment(machine=machine.name, chuck=machine.chuck.name, tool=machine.tool.name)


def clamping_of(job: Job, at: str) -> Clamping:
    """Return the clamping stamp for the blank of a job."""
    return Clamping(force_n=job.chucking_force_n, at=at, **{key: getattr(job, key) for key in _BLANK})


def observe_poll(
    alignment: Alignment, *, drives_on: bool, homed: bool, at: str, chuck_open: bool = False
) -> Alignment:
    """Return the alignment after a status poll. Without home, jaw 1 and the touch-off mean nothing.

    `chuck_open` is what the controller senses of the chuck, where it can.
    """
    if chuck_open:
        alignment = unclamp_blank(alignment, at)
    if alignment.drives_on == drives_on and alignment.homed == homed:
        return alignment
    after = replace(alignment, drives_on=drives_on, homed=homed)
    if homed:
        return _drop_losses(after, "alignment.home_lost")
    after = replace(after, flanks=(), skim_counts=None)
    if alignment.homed and (alignment.jaw or alignment.touch_off):
        return _add_loss(replace(after, jaw=None, touch_off=None), Problem(code="alignment.home_lost", value=at))
    return after


def unclamp_blank(alignment: Alignment, at: str) -> Alignment:
    """Return the alignment after the chuck was opened."""
    if alignment.clamping is None:
        return alignment
    return _add_loss(
        replace(alignment, clamping=None, skim_counts=None, readings=None),
        Problem(code="alignment.unclamped", value=at),
    )


def after_last_cut(alignment: Alignment, *, ended_early: bool) -> Alignment:
    """Return the alignment where the part in the chuck may be cut in part, until a clamping is confirmed."""
    if alignment.clamping is not None:
        return alignment
    known = _drop_losses(alignment, ENDED_EARLY)
    return _add_loss(known, Problem(code=ENDED_EARLY)) if ended_early else known


def clamp_blank(alignment: Alignment, job: Job, at: str) -> Alignment:
    """Return the alignment with the blank of a job; a change of jaws requires finding jaw 1 again."""
    before = alignment.jaw or alignment.clamping
    flanks = alignment.flanks if before is None or before.jaws == job.jaws else ()
    fresh = replace(alignment, clamping=clamping_of(job, at), skim_counts=None, flanks=flanks, readings=None)
    fresh = _drop_losses(fresh, ENDED_EARLY, "alignment.unclamped", HANDED_OVER, NOT_KEPT)
    if alignment.jaw is None or alignment.jaw.jaws == job.jaws:
        return fresh
    return _add_loss(replace(fresh, jaw=None), Problem(code="alignment.jaws_changed", value=at))


def jaw_found(
    alignment: Alignment, angle_deg: float, jaws: int, at: str, spread_deg: float | None = None
) -> Alignment:
    """Return the alignment with jaw 1 at an angle from the index, for this number of jaws."""
    stamp = JawAngle(angle_deg=angle_deg % 360.0, jaws=jaws, at=at, on=alignment.on, spread_deg=spread_deg)
    return _drop_losses(replace(alignment, jaw=stamp, flanks=()), "alignment.jaws_changed")


def touched_off(alignment: Alignment, stamp: TouchOff) -> Alignment:
    """Return the alignment with the radius of the tool tip found."""
    return _drop_losses(replace(alignment, touch_off=stamp, skim_counts=None), "alignment.retuned")


def without_reading(alignment: Alignment) -> Alignment:
    """Return the alignment without the newest reading: a flank, a skim cut, the touch-off, or else jaw 1."""
    if alignment.flanks:
        return replace(alignment, flanks=alignment.flanks[:-1])
    if alignment.skim_counts is not None:
        return replace(alignment, skim_counts=None)
    return replace(alignment, jaw=None) if alignment.touch_off is None else replace(alignment, touch_off=None)


def handed_over(alignment: Alignment, at: str, code: str = HANDED_OVER) -> Alignment:
    """Return the alignment after another console has had control, or this one has lost it (`NOT_KEPT`)."""
    alignment = replace(alignment, flanks=(), skim_counts=None, readings=None)
    if alignment.clamping is None and alignment.jaw is None and alignment.touch_off is None:
        return alignment
    kept = _find_losses(alignment, ENDED_EARLY)
    gone = replace(alignment, clamping=None, jaw=None, touch_off=None, lost=kept)
    return _add_loss(gone, Problem(code=code, value=at))


def invalidate_retuned_tool(alignment: Alignment, at: str) -> Alignment:
    """Return the alignment after other gains of the tool: under force it stands elsewhere than it did.

    Home is an index pulse, jaw 1 an angle of the spindle: neither depends on the loop of the tool.
    """
    alignment = replace(alignment, skim_counts=None)
    if alignment.touch_off is None:
        return alignment
    return _add_loss(replace(alignment, touch_off=None), Problem(code="alignment.retuned", value=at))


def step_problems(alignment: Alignment, step: AlignStep, job: Job) -> tuple[Problem, ...]:
    """Return why a step is not yet done for this job; empty when it is."""
    return _by_step(SameObjects(alignment, job))[step]  # a page asks for each ten times a second


def stamp_problems(alignment: Alignment, step: AlignStep, job: Job) -> tuple[Problem, ...]:
    """Return why what was taken in a step is not of this job; a table that was left on undoes no clamping."""
    left_on = table_problems(alignment)
    return tuple(problem for problem in step_problems(alignment, step, job) if problem not in left_on)


@lru_cache(maxsize=8)
def _by_step(of: SameObjects[Alignment, Job]) -> dict[AlignStep, tuple[Problem, ...]]:
    return {step: _step_problems(of.one, step, of.other) for step in AlignStep}


def _step_problems(alignment: Alignment, step: AlignStep, job: Job) -> tuple[Problem, ...]:
    match step:
        case AlignStep.VERIFY:
            settings = alignment.settings
            return (Problem(code="alignment.not_verified"),) if settings is None else settings
        case AlignStep.CLAMP:
            return (*table_problems(alignment), *_clamp(alignment, job))
        case AlignStep.DRIVES:
            return () if alignment.drives_on else (Problem(code="alignment.drives_off"),)
        case AlignStep.HOME:
            lost = (*_find_losses(alignment, "alignment.home_lost"), Problem(code="alignment.not_homed"))
            return () if alignment.homed else lost
        case AlignStep.JAW:
            return _jaw(alignment, job)
        case AlignStep.TOUCH_OFF:
            return _touch_off(alignment, job)


def problems(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    """Return every reason why the alignment is not valid for this job."""
    return tuple(problem for found in _by_step(SameObjects(alignment, job)).values() for problem in found)


def current_step(alignment: Alignment, job: Job) -> AlignStep | None:
    """Return the first step that is not done, None when all are."""
    return next((step for step, found in _by_step(SameObjects(alignment, job)).items() if found), None)


def step_now(alignment: Alignment, job: Job | None) -> AlignStep | None:
    """Return the present step; without a job only a step that needs none."""
    if job is not None:
        return current_step(alignment, job)
    steps = (AlignStep.VERIFY, AlignStep.DRIVES, AlignStep.HOME)
    return next((step for step in steps if not is_done(alignment, step, None)), None)


def is_done(alignment: Alignment, step: AlignStep, job: Job | None) -> bool:
    """Whether a step is done for a job; without one, as far as that can be said."""
    if job is not None:
        return not step_problems(alignment, step, job)
    done = {
        AlignStep.VERIFY: alignment.settings == (),
        AlignStep.DRIVES: alignment.drives_on,
        AlignStep.HOME: alignment.homed,
        AlignStep.JAW: alignment.jaw is not None,
    }
    return done.get(step, False)


def force_problems(job: Job) -> tuple[Problem, ...]:
    """Return why the job's chucking force is not the one at which its lobe error was measured."""
    finding = force_as_measured(job)
    return () if finding.severity is Severity.OK else (finding.problem,)


def aligned_job(job: Job, alignment: Alignment) -> Job:
    """Return the job with jaw 1 where it was found, else as in its file; the lobe keeps its offset from it.

    Jaw 1 of another mounting does not apply to this job.
    """
    if alignment.jaw is None or _jaw(alignment, job):
        return job
    return replace(job, lobe_phase_deg=(alignment.jaw.angle_deg + (job.lobe_past_jaw_deg or 0.0)) % 360.0)


def aligned_machine(machine: MachineProfile, alignment: Alignment) -> MachineProfile:
    """Return the machine with the tool tip from the touch-off, else from its profile.

    The tip does not depend on what is clamped: only a change of tool or machine invalidates it.
    """
    touched = touch_off_here(alignment)
    if touched is None:
        return machine
    return replace(machine, tool=replace(machine.tool, home_radius_mm=touched.zero_radius_mm))


def touch_off_here(alignment: Alignment) -> TouchOff | None:
    """Return the touch-off with the tool that is mounted on the machine at hand; None without one."""
    touched = alignment.touch_off
    if touched is None or _mounted_otherwise(alignment, touched.on, "machine", "tool"):
        return None
    return touched


def _clamp(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    clamping = alignment.clamping
    if clamping is None:
        return (
            *_find_losses(alignment, ENDED_EARLY, "alignment.unclamped", HANDED_OVER, NOT_KEPT),
            Problem(code="alignment.no_clamping"),
            *force_problems(job),
        )
    if not same_force(clamping.force_n, job.chucking_force_n):
        value, limit = f"{clamping.force_n:g} N", f"{job.chucking_force_n:g} N"
        return (Problem(code="alignment.clamped_otherwise", key="chucking_force_n", value=value, limit=limit),)
    for key, unit in _BLANK.items():
        stamped, target = getattr(clamping, key), getattr(job, key)
        if stamped != target:
            value, limit = (f"{each:g} {unit}" if unit else str(each) for each in (stamped, target))
            return (Problem(code="alignment.clamped_otherwise", key=key, value=value, limit=limit),)
    return force_problems(job)


def _jaw(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    jaw = alignment.jaw
    if jaw is None:
        return (*_find_losses(alignment, "alignment.jaws_changed"), Problem(code="alignment.no_jaw"))
    if jaw.jaws != job.jaws:
        return (Problem(code="alignment.jaw_of_others", key="jaws", value=str(jaw.jaws), limit=str(job.jaws)),)
    return _mounted_otherwise(alignment, jaw.on, "machine", "chuck")


def _touch_off(alignment: Alignment, job: Job) -> tuple[Problem, ...]:
    touched = alignment.touch_off
    if touched is None:
        return (*_find_losses(alignment, "alignment.retuned"), Problem(code="alignment.no_touch_off"))
    if touched.diameter_mm != job.diameter_mm:
        value, limit = f"D {touched.diameter_mm:.3f} mm", f"D {job.diameter_mm:.3f} mm"
        return (Problem(code="alignment.touched_otherwise", key="diameter_mm", value=value, limit=limit),)
    return _mounted_otherwise(alignment, touched.on, "machine", "tool")


def _mounted_otherwise(alignment: Alignment, stamped: MountedEquipment, *names: str) -> tuple[Problem, ...]:
    pairs = ((f"{name}.name", getattr(stamped, name), getattr(alignment.on, name)) for name in names)
    return tuple(
        Problem(code="alignment.mounted_otherwise", key=key, value=f'"{then}"', limit=f'"{now}"')
        for key, then, now in pairs
        if then != now
    )


def _add_loss(alignment: Alignment, why: Problem) -> Alignment:
    """Return the alignment with one more reason why a stamp was lost, the newest of its kind."""
    return replace(alignment, lost=(*_drop_losses(alignment, why.code).lost, why))


def _drop_losses(alignment: Alignment, *codes: str) -> Alignment:
    """Return the alignment without these reasons: the stamps they concern are valid again."""
    return replace(alignment, lost=tuple(each for each in alignment.lost if each.code not in codes))


def _find_losses(alignment: Alignment, *codes: str) -> tuple[Problem, ...]:
    return tuple(problem for problem in alignment.lost if problem.code in codes)
