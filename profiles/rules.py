"""Check a job against a machine. Every rule is judged, and each gives a finding with its numbers.

Codes, with what is refused:

- `rule.wall_over_radius`      a wall thicker than the radius (equal: a solid bar)
- `rule.depth_over_wall`       a cut that, with the lobe on top, leaves less than `LEAST_WALL_MM` of the wall
- `rule.depth_under_lobe`      a depth that does not hold the lobe: between its maxima the tool leaves the part
- `rule.clamp_stress`          a thin part that yields under the jaws
- `rule.length_over_overhang`  a cut that comes nearer to the jaws than their clearance
- `rule.speed_over_machine`    a spindle speed above the machine's
- `rule.force_over_chuck`      a chucking force above the chuck's
- `rule.grip_margin`           F_sp0 / S_sp - F_c below 0 (VDI 3106)
- `rule.grip_loss`             a centrifugal loss above 67 % of the force at rest (DIN EN 1550)
- `rule.feed_over_land`        a feed per turn above the tool's wiper land, which leaves a thread
- `rule.tool_travel`           a radius, or the clearance over it, that the tool axis cannot reach
- `rule.carriage_travel`       a cut whose ends the carriage cannot reach
- `rule.tool_force`            a lobe that needs more than the continuous thrust of the tool axis
- `rule.encoder_acceleration`  a lobe that shakes the tool harder than its encoder allows
- `rule.grip_need`             (warning) the same below what the cut needs, S_z F_spz
- `rule.material_unknown`      (warning) a material without numbers: what the cut needs of the grip counts as 0
- `rule.clamp_scatter`         (warning) a lobe that changes by more than the tolerance from clamping to clamping
- `rule.clamp_span`            (warning) a least force above the most: none will do. Where there is a span, and the
                               force of the job is outside, only the rule speaks whose limit it breaks
- `rule.jaws_differ`           (warning) another number of jaws than the machine's own chuck
- `rule.force_differs`         (warning) another chucking force than the one at which the lobe error was found
- `rule.lobe_differs`          (warning) another speed, length, chuck or tool than the lobe error was found with
- `rule.lobe_unstated`         (warning) an error that was found on a part, without the conditions of that cut
- `rule.chatter_width`         (warning) a cut wider than the part bears without chatter

An error found with no condition stated is not compared, and gives no finding of agreement. The
last two need a part that can be held and cut, of a known material.
"""

from __future__ import annotations

import math

from profiles.chucking.advice import force_span
from profiles.chucking.grip import MOST_GRIP_LOSS
from profiles.chucking.holding import holding_of
from profiles.chucking.job_grip import centrifugal_loss_n, force_sd_n, grip_margin_n, lobe_um_per_n, needed_grip_n
from profiles.chucking.ring import Ring, bending_stress_mpa, is_thin
from profiles.findings import Finding, Severity, refusals
from profiles.job import Job
from profiles.lobe.lobe_conditions import any_stated, force_as_found, lobe_differences, lobe_unstated
from profiles.machine import MachineProfile
from profiles.materials import material_or_none, unknown_material
from profiles.problem import Problem

IMPOSSIBLE = ("rule.wall_over_radius", "rule.depth_over_wall", "rule.grip_margin")
"""Refusals where no model applies: a part that cannot be held or cut at all."""

LEAST_WALL_MM = 0.2
"""Of the wall left where the tool is deepest. A thinner one yields to the chip, not to the jaws."""

SAME_FORCE = 0.005
"""Relative difference at which two chucking forces are still the same setting of the wrench."""


def check(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return one finding for every rule that can be judged, in the order of the module's list."""
    of_part, of_grip = _part(job, machine), _grip(job, machine)
    return (
        *of_part,
        *of_grip,
        *_clamping(job, machine),
        _clamp_span(job, machine),
        _at_most("rule.feed_over_land", "feed_mm_per_rev", job.feed_mm_per_rev, machine.tool.wiper_land_mm, "mm"),
        _tool_travel(job, machine),
        _carriage_travel(job, machine),
        *_tool_load(job, machine),
        _jaws(job, machine),
        *(() if job.lobe_force_n is None else (force_as_measured(job),)),
        *lobe_as_found(job, machine),
        *_chatter(job, machine, (*of_part, *of_grip)),
    )


def same_force(one_n: float, other_n: float) -> bool:
    """Whether two chucking forces are the same setting of the wrench."""
    return abs(one_n - other_n) <= SAME_FORCE * max(one_n, other_n)


def force_as_measured(job: Job) -> Finding:
    """Return whether the part is held as when its lobe error was found: the error depends on the force."""
    severity = Severity.OK if force_as_found(job) else Severity.WARNING
    value, limit = f"{job.chucking_force_n:.6g} N", f"{job.error_force_n:.6g} N"
    problem = Problem(code="rule.force_differs", key="chucking_force_n", value=value, limit=limit)
    return Finding(severity=severity, problem=problem)


def lobe_as_found(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return what else differs from the cut in which the lobe error was found, and whether this can be judged.

    One finding where everything stated is the same; none where nothing is stated.
    """
    differing = lobe_differences(job, chuck=machine.chuck.name, tool=machine.tool.name)
    minded = (*differing, *lobe_unstated(job))
    if minded:
        return tuple(Finding(severity=Severity.WARNING, problem=problem) for problem in minded)
    if not any_stated(job):
        return ()
    return (Finding(severity=Severity.OK, problem=Problem(code="rule.lobe_differs", key="lobe_error_um_pp")),)


def _chatter(job: Job, machine: MachineProfile, judged: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Judge whether a part that can be held and cut tolerates the width of cut."""
    impossible = any(finding.problem.code in IMPOSSIBLE for finding in refusals(judged))
    if impossible or material_or_none(job.material) is None:
        return ()
    from profiles.lobe.one_pass import chatter_limit_mm  # loads numerics, which the first page does not need

    depth_mm, most_mm = job.depth_of_cut_mm, chatter_limit_mm(job, machine)
    return (_at_most("rule.chatter_width", "depth_of_cut_mm", depth_mm, most_mm, "mm", Severity.WARNING),)


def _part(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    wall, carriage = job.wall_thickness_mm, machine.carriage
    lobe_mm = job.largest_amplitude_um / 1000
    left_mm, depth_mm = wall - job.depth_of_cut_mm - lobe_mm, job.depth_of_cut_mm
    free_mm = job.overhang_mm - carriage.jaw_clearance_mm
    speed, force = job.spindle_speed_rpm, job.chucking_force_n
    return (
        _at_most("rule.wall_over_radius", "wall_thickness_mm", wall, job.radius_mm, "mm"),
        _at_least("rule.depth_over_wall", "depth_of_cut_mm", left_mm, LEAST_WALL_MM, "mm"),
        _depth_under_lobe(depth_mm, lobe_mm),
        _at_most("rule.length_over_overhang", "cut_length_mm", job.cut_length_mm, free_mm, "mm"),
        _at_most("rule.speed_over_machine", "spindle_speed_rpm", speed, machine.spindle.max_speed_rpm, "rpm"),
        _at_most("rule.force_over_chuck", "chucking_force_n", force, machine.chuck.max_force_n, "N"),
    )


def _depth_under_lobe(depth_mm: float, lobe_mm: float) -> Finding:
    """Check the path, mean depth plus and minus the lobe: its outermost point must be in the part.

    The initial surface was turned in this clamping, and is round there. Where the tool is out of it nothing is
    removed, and the released part keeps that much of its lobe.
    """
    return _finding("rule.depth_under_lobe", "depth_of_cut_mm", depth_mm > lobe_mm, depth_mm, ">", lobe_mm, "mm")


def _grip(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    margin_n, loss_n = grip_margin_n(job, machine), centrifugal_loss_n(job, machine)
    most_n = MOST_GRIP_LOSS * job.chucking_force_n
    need_n = needed_grip_n(job, machine)
    return (
        _finding("rule.grip_margin", "chucking_force_n", margin_n >= 0, margin_n, ">=", 0, "N"),
        _finding(
            "rule.grip_need", "chucking_force_n", margin_n >= need_n, margin_n, ">=", need_n, "N", Severity.WARNING
        ),
        _at_most("rule.grip_loss", "spindle_speed_rpm", loss_n, most_n, "N"),
    )


def _clamping(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Check the effect of the force; the stress if the material is known and the wall thin enough to bend."""
    material, holding = material_or_none(job.material), holding_of(machine)
    scatter_um = lobe_um_per_n(job, machine) * force_sd_n(job, machine)
    scatter = _at_most(
        "rule.clamp_scatter", "chucking_force_n", scatter_um, job.roundness_tolerance_um, "um", Severity.WARNING
    )
    if material is None:
        unknown = Finding(severity=Severity.WARNING, problem=unknown_material(job.material))
        return (unknown, scatter)
    known = Finding(severity=Severity.OK, problem=unknown_material(job.material))
    if not is_thin(job.wall_thickness_mm, job.radius_mm):
        return (known, scatter)
    ring = Ring(
        outside_mm=job.diameter_mm,
        wall_mm=job.wall_thickness_mm,
        length_mm=holding.jaw_length_mm,
        material=material,
    )
    stress_mpa = bending_stress_mpa(ring, job.jaws, job.chucking_force_n / job.jaws)
    return (known, _stress(job, stress_mpa, material.yield_mpa), scatter)


def _stress(job: Job, stress_mpa: float, yield_mpa: float) -> Finding:
    """Check the stress; the limit also gives the force, rounded down, at which the part still springs back."""
    most_n = math.floor(job.chucking_force_n * yield_mpa / stress_mpa)
    limit = f"<= {yield_mpa:.6g} MPa ({most_n} N)"
    problem = Problem(code="rule.clamp_stress", key="chucking_force_n", value=f"{stress_mpa:.6g} MPa", limit=limit)
    return Finding(severity=Severity.OK if stress_mpa <= yield_mpa else Severity.REFUSAL, problem=problem)


def _clamp_span(job: Job, machine: MachineProfile) -> Finding:
    span = force_span(job, machine)
    least_n, most_n, severity = span.least_n, span.most_n, Severity.WARNING
    return _finding("rule.clamp_span", "chucking_force_n", not span.empty, least_n, "<=", most_n, "N", severity)


def _tool_travel(job: Job, machine: MachineProfile) -> Finding:
    """Check that the tool can clear the blank by the retract distance and reach the deepest point of the cut."""
    tool = machine.tool
    surface_mm = tool.home_radius_mm - job.radius_mm
    out_mm = surface_mm - tool.retract_mm
    in_mm = surface_mm + job.depth_of_cut_mm + job.largest_amplitude_um / 1000
    holds = tool.travel_min_mm <= out_mm and in_mm <= tool.travel_max_mm
    return _span("rule.tool_travel", "diameter_mm", holds, (out_mm, in_mm), tool.travel_min_mm, tool.travel_max_mm)


def _carriage_travel(job: Job, machine: MachineProfile) -> Finding:
    carriage = machine.carriage
    start_mm = carriage.jaw_face_mm - job.overhang_mm
    end_mm = start_mm + job.cut_length_mm
    low_mm, high_mm = carriage.travel_min_mm, carriage.travel_max_mm
    holds = low_mm <= start_mm and end_mm <= high_mm
    return _span("rule.carriage_travel", "overhang_mm", holds, (start_mm, end_mm), low_mm, high_mm)


def _tool_load(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Check a sine of the lobe's amplitude: thrust |-M w^2 + j B w| A / sqrt(2), acceleration A w^2."""
    tool = machine.tool
    amplitude_m = job.lobe_amplitude_um * 1e-6
    omega = 2 * math.pi * job.lobe_frequency_hz
    force_n = amplitude_m * omega * math.hypot(tool.moving_mass_kg * omega, tool.damping_n_s_per_m) / math.sqrt(2)
    acceleration = amplitude_m * omega**2
    most = tool.encoder_max_acceleration_m_per_s2
    return (
        _at_most("rule.tool_force", "lobe_error_um_pp", force_n, tool.continuous_force_n, "N"),
        _at_most("rule.encoder_acceleration", "lobe_error_um_pp", acceleration, most, "m/s2"),
    )


def _jaws(job: Job, machine: MachineProfile) -> Finding:
    severity = Severity.OK if job.jaws == machine.chuck.jaws else Severity.WARNING
    value, limit = str(job.jaws), str(machine.chuck.jaws)
    return Finding(
        severity=severity, problem=Problem(code="rule.jaws_differ", key="jaws", value=value, limit=limit)
    )


def _at_most(
    code: str, key: str, value: float, most: float, unit: str, otherwise: Severity = Severity.REFUSAL
) -> Finding:
    return _finding(code, key, value <= most, value, "<=", most, unit, otherwise)


def _at_least(code: str, key: str, value: float, least: float, unit: str) -> Finding:
    return _finding(code, key, value >= least, value, ">=", least, unit)


def _finding(
    code: str,
    key: str,
    holds: bool,
    value: float,
    relation: str,
    bound: float,
    unit: str,
    otherwise: Severity = Severity.REFUSAL,
) -> Finding:
    problem = Problem(code=code, key=key, value=f"{value:.6g} {unit}", limit=f"{relation} {bound:.6g} {unit}")
    return Finding(severity=Severity.OK if holds else otherwise, problem=problem)


def _span(code: str, key: str, holds: bool, met_mm: tuple[float, float], low_mm: float, high_mm: float) -> Finding:
    problem = Problem(
        code=code, key=key, value=f"{met_mm[0]:.6g} … {met_mm[1]:.6g} mm", limit=f"{low_mm:.6g} … {high_mm:.6g} mm"
    )
    return Finding(severity=Severity.OK if holds else Severity.REFUSAL, problem=problem)
