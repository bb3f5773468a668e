"""Compare this cut with the one in which the lobe error was found: the error depends on holding and cutting.

A thin ring springs back in proportion to the force that holds it at speed and to the cube of radius over wall,
and less the further from the jaws it is cut. So a compensation is valid for the conditions of its calibration
cut, within limits that change the lobe by no more than the next clamping does: 1.5 % of the wall are 4.5 % of
the lobe, 0.1 mm of a diameter of 52 mm are 0.6 %, and 2 % of the speed are 1 % where a fifth of the force is
lost. Another number of jaws makes another lobe, and another material springs back by its own modulus. What the
job does not state cannot be judged; where its error was found on a part, that is reported.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from profiles.job import Job
from profiles.materials import material_or_none
from profiles.problem import Problem

FORCE_TOLERANCE = 0.05  # relative tolerance of the force: the scatter of a good wrench between clampings
SPEED_TOLERANCE = 0.02
WALL_TOLERANCE = 0.015
LENGTH_MM = 0.1

_TOLERANCES = (("spindle_speed_rpm", "rpm", SPEED_TOLERANCE), ("wall_thickness_mm", "mm", WALL_TOLERANCE))
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
"""The conditions of the calibration cut in a job, and the job's own key for each."""

NAMES = ("lobe_chuck", "lobe_tool")

_STATED_OF = {own: stated for stated, own in CONDITIONS.items()}
MEASURED = ("measured", "fitted")
"""Sources of a lobe error that was found on a part."""

OTHER_CUT = "other_cut"  # source of an error found on a part that was held or cut differently from this job


def found_on_a_part(job: Job) -> bool:
    """Whether the lobe error was found on a part in as many jaws; else it is modelled or assumed."""
    return job.lobe_error_source in MEASURED and job.lobe_jaws in (None, job.jaws)


def lobe_source(job: Job, *, chuck: str | None = None, tool: str | None = None) -> str:
    """Return the source of the lobe error of this cut: `OTHER_CUT` where a condition differs.

    `chuck` and `tool` are the names of those in the machine; None means no machine to compare with.
    """
    if job.lobe_error_source not in MEASURED:
        return job.lobe_error_source
    of_names = ((job.lobe_chuck, chuck), (job.lobe_tool, tool))
    other = any(pair[0] and pair[1] is not None and pair[0] != pair[1] for pair in of_names)
    return OTHER_CUT if other or changed_conditions(job) else job.lobe_error_source


def changed_conditions(job: Job) -> dict[str, Any]:
    """Return the conditions of the job that differ from its calibration cut, each with the value there."""
    differing = {problem.key for problem in _of_conditions(job)}
    if not force_as_found(job):
        differing.add("chucking_force_n")
    return {own: getattr(job, stated) for stated, own in CONDITIONS.items() if own in differing}


def force_as_found(job: Job) -> bool:
    """Whether the chucking force is that of the calibration cut."""
    return abs(job.chucking_force_n - job.error_force_n) <= FORCE_TOLERANCE * job.error_force_n


def lobe_differences(job: Job, *, chuck: str, tool: str) -> tuple[Problem, ...]:
    """Return what differs from the calibration cut, except the force.

    `chuck` and `tool` are the names of those in the machine; "" is unknown.
    """
    found = _of_conditions(job)
    for key, name, named in (("chuck", chuck, job.lobe_chuck), ("tool", tool, job.lobe_tool)):
        if named and name != named:
            found.append(_differs(f"{key}.name", f'"{name}"', f'"{named}"'))
    return tuple(found)


def _of_conditions(job: Job) -> list[Problem]:
    """Return the differences in numbers and material, except the force."""
    found: list[Problem] = []
    for key, unit, fraction in _TOLERANCES:
        actual, then = getattr(job, key), getattr(job, f"lobe_{key}")
        # To a millionth, so that a value at the limit passes.
        if then is not None and round(abs(actual - then) / then, 6) > fraction:
            found.append(_differs(key, f"{actual:.6g} {unit}", f"{then:.6g} {unit}"))
    for key in _LENGTHS:
        actual, then = getattr(job, key), getattr(job, f"lobe_{key}")
        # To a nanometre, so that 30.1 is within a tenth of 30.
        if then is not None and round(abs(actual - then), 6) > LENGTH_MM:
            found.append(_differs(key, f"{actual:.6g} mm", f"{then:.6g} mm"))
    if job.lobe_material is not None and not _springs_back_alike(job.material, job.lobe_material):
        found.append(_differs("material", job.material, job.lobe_material))
    if job.lobe_jaws not in (None, job.jaws):
        found.append(_differs("jaws", str(job.jaws), str(job.lobe_jaws)))
    return found


def _springs_back_alike(one: str, other: str) -> bool:
    """Whether two materials have the same elastic constants; unknown ones must have the same name."""
    found, then = material_or_none(one), material_or_none(other)
    if found is None or then is None:
        return one.strip().lower() == other.strip().lower()
    return (found.youngs_modulus_gpa, found.poisson) == (then.youngs_modulus_gpa, then.poisson)


def find_missing_conditions(job: Job) -> tuple[str, ...]:
    """Return the keys of the calibration cut that are missing in a job whose error was found on a part."""
    if not found_on_a_part(job):
        return ()
    return tuple(key for key in (*CONDITIONS, *NAMES) if not getattr(job, key))


def lobe_unstated(job: Job) -> tuple[Problem, ...]:
    """Return `rule.lobe_unstated` where this cut cannot be compared with the measured one."""
    if not (missing := find_missing_conditions(job)):
        return ()
    source = job.lobe_error_source
    return (Problem(code="rule.lobe_unstated", key="lobe_error_source", value=source, limit=", ".join(missing)),)


def any_stated(job: Job) -> bool:
    """Whether the job states anything about its calibration cut, except the force."""
    return any(getattr(job, key) for key in (*CONDITIONS, *NAMES) if key != "lobe_force_n")


def as_found(job: Job) -> Job:
    """Return the job as it was cut when its error was found; unstated conditions are its own."""
    stated = {own: getattr(job, key) for key, own in CONDITIONS.items()}
    return replace(job, **{own: value for own, value in stated.items() if value is not None})


def kept_condition(saved: Job, key: str, value: Any) -> dict[str, Any]:
    """Return what ties the error of a job to its calibration cut, when `key` changes to `value`.

    `saved` is the job in its file. Where that does not state the condition, it is the value in the file;
    setting that value again makes the condition unstated as before.
    """
    stated = _STATED_OF.get(key)
    if stated is None or getattr(saved, stated) is not None:
        return {}
    own = getattr(saved, key)
    return {stated: None if value == own else own}


def _differs(key: str, value: str, limit: str) -> Problem:
    return Problem(code="rule.lobe_differs", key=key, value=value, limit=limit)
