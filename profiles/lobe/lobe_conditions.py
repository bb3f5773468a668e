"""Is this cut like the one in which the lobe error was found? The error goes with how the part was held and cut.

A thin ring springs back in proportion to the force that holds it at speed and to the cube of radius over wall, and
less the further from the jaws it is cut. So a compensation holds for the conditions of its calibration cut, within
limits that change the lobe by no more than the next clamping does: 1.5 % of the wall are 4.5 % of the lobe, 0.1 mm
of a diameter of 52 mm are 0.6 %, and 2 % of the speed are 1 % where a fifth of the force is lost. Another number
of jaws makes another lobe, and another material springs back by its own modulus. What the job does not state
cannot be judged; where its error was found on a part, that is told.

Problem codes: `rule.lobe_differs`, one for each condition; `rule.lobe_unstated`, one for all that are missing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from profiles.job import Job
from profiles.materials import material_or_none
from profiles.problem import Problem

FORCE_SHARE = 0.05
"""Share by which the force may be off: what a good wrench scatters by from clamping to clamping."""

SPEED_SHARE = 0.02
WALL_SHARE = 0.015
LENGTH_MM = 0.1

_SHARES = (("spindle_speed_rpm", "rpm", SPEED_SHARE), ("wall_thickness_mm", "mm", WALL_SHARE))
_LENGTHS = ("overhang_mm", "diameter_mm")

CONDITIONS = {
    "lobe_force_n": "chucking_force_n",
    "lobe_spindle_speed_rpm": "spindle_speed_rpm",
    "lobe_overhang_mm": "overhang_mm",
    "lobe_wall_thickness_mm": "wall_thickness_mm",
    "lobe_diameter_mm": "diameter_mm",
    "lobe_material": "material",
    "lobe_jaws": "jaws",
}
"""What a job says of its calibration cut, and the key of its own that each belongs to."""

NAMES = ("lobe_chuck", "lobe_tool")

_STATED_OF = {own: stated for stated, own in CONDITIONS.items()}
_FOUND_ON_A_PART = ("measured", "fitted")

OTHER_CUT = "other_cut"
"""Where an error comes from that was found on a part, but not on one that is held and cut as this job says."""


def found_on_a_part(job: Job) -> bool:
    """Whether the lobe error was seen on a part in as many jaws; else a model says it, or somebody assumes it."""
    return job.lobe_error_source in _FOUND_ON_A_PART and job.lobe_jaws in (None, job.jaws)


def lobe_source(job: Job, *, chuck: str | None = None, tool: str | None = None) -> str:
    """Return where the lobe error of this cut comes from: `OTHER_CUT` where a condition is not the one measured.

    `chuck` and `tool` are the names of those in the machine; None is no machine to compare with.
    """
    if job.lobe_error_source not in _FOUND_ON_A_PART:
        return job.lobe_error_source
    of_names = ((job.lobe_chuck, chuck), (job.lobe_tool, tool))
    other = any(pair[0] and pair[1] is not None and pair[0] != pair[1] for pair in of_names)
    return OTHER_CUT if other or changed_conditions(job) else job.lobe_error_source


def changed_conditions(job: Job) -> dict[str, Any]:
    """Return the conditions of the job that are not those of its calibration cut, each with what it was there."""
    differing = {problem.key for problem in _of_conditions(job)}
    if not force_as_found(job):
        differing.add("chucking_force_n")
    return {own: getattr(job, stated) for stated, own in CONDITIONS.items() if own in differing}


def force_as_found(job: Job) -> bool:
    """Whether the chucking force is that of the calibration cut."""
    return abs(job.chucking_force_n - job.error_force_n) <= FORCE_SHARE * job.error_force_n


def lobe_differences(job: Job, *, chuck: str, tool: str) -> tuple[Problem, ...]:
    """Return what differs from the calibration cut, except the force.

    `chuck` and `tool` are the names of those in the machine; "" is none that anybody knows.
    """
    found = _of_conditions(job)
    for key, name, named in (("chuck", chuck, job.lobe_chuck), ("tool", tool, job.lobe_tool)):
        if named and name != named:
            found.append(_differs(f"{key}.name", f'"{name}"', f'"{named}"'))
    return tuple(found)


def _of_conditions(job: Job) -> list[Problem]:
    """Return what differs in numbers and material, except the force."""
    found: list[Problem] = []
    for key, unit, share in _SHARES:
        met, then = getattr(job, key), getattr(job, f"lobe_{key}")
        # To a millionth, so that a limit that is met is kept.
        if then is not None and round(abs(met - then) / then, 6) > share:
            found.append(_differs(key, f"{met:.6g} {unit}", f"{then:.6g} {unit}"))
    for key in _LENGTHS:
        met, then = getattr(job, key), getattr(job, f"lobe_{key}")
        # To a nanometre, so that 30.1 is within a tenth of 30.
        if then is not None and round(abs(met - then), 6) > LENGTH_MM:
            found.append(_differs(key, f"{met:.6g} mm", f"{then:.6g} mm"))
    if job.lobe_material is not None and not _springs_back_alike(job.material, job.lobe_material):
        found.append(_differs("material", job.material, job.lobe_material))
    if job.lobe_jaws not in (None, job.jaws):
        found.append(_differs("jaws", str(job.jaws), str(job.lobe_jaws)))
    return found


def _springs_back_alike(one: str, other: str) -> bool:
    """Whether two materials have the same elastic constants; of unknown ones the words must be the same."""
    found, then = material_or_none(one), material_or_none(other)
    if found is None or then is None:
        return one.strip().lower() == other.strip().lower()
    return (found.youngs_modulus_gpa, found.poisson) == (then.youngs_modulus_gpa, then.poisson)


def unstated(job: Job) -> tuple[str, ...]:
    """Return the keys of the calibration cut that are missing in a job whose error was found on a part."""
    if not found_on_a_part(job):
        return ()
    return tuple(key for key in (*CONDITIONS, *NAMES) if not getattr(job, key))


def lobe_unstated(job: Job) -> tuple[Problem, ...]:
    """Return `rule.lobe_unstated` where nobody can tell whether this cut is like the one that was measured."""
    if not (missing := unstated(job)):
        return ()
    source = job.lobe_error_source
    return (Problem(code="rule.lobe_unstated", key="lobe_error_source", value=source, limit=", ".join(missing)),)


def any_stated(job: Job) -> bool:
    """Whether the job says anything of its calibration cut, except the force."""
    return any(getattr(job, key) for key in (*CONDITIONS, *NAMES) if key != "lobe_force_n")


def as_found(job: Job) -> Job:
    """Return the job as it was cut when its error was found; what it does not state is its own."""
    stated = {own: getattr(job, key) for key, own in CONDITIONS.items()}
    return replace(job, **{own: value for own, value in stated.items() if value is not None})


def kept_condition(saved: Job, key: str, value: Any) -> dict[str, Any]:
    """Return what keeps the error of a job at the cut that it belongs to, when `key` of it becomes `value`.

    `saved` is the job as its file has it. Where that does not state the condition it is the value in the file;
    with that value again the condition is as little known as before.
    """
    stated = _STATED_OF.get(key)
    if stated is None or getattr(saved, stated) is not None:
        return {}
    own = getattr(saved, key)
    return {stated: None if value == own else own}


def _differs(key: str, value: str, limit: str) -> Problem:
    return Problem(code="rule.lobe_differs", key=key, value=value, limit=limit)
