"""Check a job against a machine. Every rule is judged, and each gives a finding with its numbers.

Codes, with what is refused:

- `rule.wall_over_radius`      a wall thicker than the radius (equal: a solid bar)
- `rule.depth_over_wall`       a cut that, with the lobe on top, leaves less than `LEAST_WALL_MM` of the wall
- `rule.depth_under_lobe`      a depth that does not hold the lobe and `LEAST_CHIP_MM`: between its maxima
                               the tool leaves the part, or rubs
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
- `rule.lobe_none`             (warning) no lobe error known yet: only a plain cut can be made
- `rule.chatter_width`         (warning) a cut wider than the part bears without chatter
- `rule.along_middle`          (warning) a lobe that is nearly none in the middle of the cut, where it is stated:
                               only a plain cut can be planned
- `rule.along_degree`          (warning) a lobe along the cut that a polynomial does not follow closely
- `rule.moving_out`            (warning) a following error that trips as the tool moves out on a table

An error found with no condition stated is not compared, and gives no finding of agreement. The
last four need a part that can be held and cut, of a known material.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

from profiles.chucking.advice import force_span, wall_stress_mpa
from profiles.chucking.grip import MOST_GRIP_LOSS, centrifugal_loss_n, grip_margin_n, lobe_um_per_n, needed_grip_n
from profiles.chucking.holding import force_as_measured, holding_of
from profiles.findings import Finding, Severity, judge_condition, refusals
from profiles.job import NO_LOBE, Job
from profiles.lobe.lobe_conditions import any_stated, lobe_differences, lobe_unstated
from profiles.machine import Carriage, MachineProfile, ToolAxis
from profiles.materials import material_or_none, unknown_material
from profiles.problem import Problem
from profiles.same_objects import SameObjects

# Refusals where no model applies: a part that cannot be held or cut at all.
IMPOSSIBLE = ("rule.wall_over_radius", "rule.depth_over_wall", "rule.grip_margin")
# Of the wall left where the tool is deepest. A thinner one yields to the chip, not to the jaws.
LEAST_WALL_MM = 0.2
# Of the depth left where the tool is shallowest (choice). A carbide edge of 20 um cuts from a quarter of its
# radius on; below that it rubs and burnishes, and no model of the cut is valid.
LEAST_CHIP_MM = 0.005


def check(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return one finding for every rule that can be judged, in the order of the module's list."""
    return _check_rules(SameObjects(job, machine))  # a page asks for its job ten times a second


@lru_cache(maxsize=4)
def _check_rules(of: SameObjects[Job, MachineProfile]) -> tuple[Finding, ...]:
    from profiles.lobe.along import along_findings, largest_lobe  # numerics, which the first page does without
    from profiles.lobe.moving_out import moving_out_findings

    job, machine = of.one, of.other
    lobe_um, lobe_z_mm = largest_lobe(job, machine)
    place = "" if lobe_z_mm is None else f" (Z {lobe_z_mm:.1f} mm)"
    of_part, of_grip = _part(job, machine, lobe_um / 1000, place), _grip(job, machine)
    span, key = force_span(job, machine), "chucking_force_n"
    jaws = Problem(code="rule.jaws_differ", key="jaws", value=str(job.jaws), limit=str(machine.chuck.jaws))
    return (
        *of_part,
        *of_grip,
        *_clamping(job, machine),
        _finding("rule.clamp_span", key, not span.empty, span.least_n, "<=", span.most_n, "N", Severity.WARNING),
        _at_most("rule.feed_over_land", "feed_mm_per_rev", job.feed_mm_per_rev, machine.tool.wiper_land_mm, "mm"),
        *_travel(job, machine, lobe_um / 1000),
        *_tool_load(job, machine, lobe_um, place),
        judge_condition(job.jaws == machine.chuck.jaws, jaws, Severity.WARNING),
        *(() if job.lobe_force_n is None else (force_as_measured(job),)),
        *lobe_as_found(job, machine),
        *_chatter(job, machine, (*of_part, *of_grip)),
        *along_findings(job, machine),
        *moving_out_findings(job, machine),
    )


def lobe_as_found(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return what else differs from the cut in which the lobe error was found, and whether this can be judged.

    One finding where everything stated is the same; none where nothing is stated.
    """
    if job.lobe_error_source == NO_LOBE:
        return (judge_condition(False, Problem(code="rule.lobe_none", key="lobe_error_source"), Severity.WARNING),)
    differing = lobe_differences(job, chuck=machine.chuck.name, tool=machine.tool.name)
    minded = (*differing, *lobe_unstated(job))
    if minded:
        return tuple(judge_condition(False, problem, Severity.WARNING) for problem in minded)
    if not any_stated(job):
        return ()
    return (judge_condition(True, Problem(code="rule.lobe_differs", key="lobe_error_um_pp")),)


def _chatter(job: Job, machine: MachineProfile, judged: tuple[Finding, ...]) -> tuple[Finding, ...]:
    impossible = any(finding.problem.code in IMPOSSIBLE for finding in refusals(judged))
    if impossible or material_or_none(job.material) is None:
        return ()
    from profiles.cutting_process import chatter_limit_mm  # loads numerics, which the first page does not need

    depth_mm, most_mm = job.depth_of_cut_mm, chatter_limit_mm(job, machine)
    return (_at_most("rule.chatter_width", "depth_of_cut_mm", depth_mm, most_mm, "mm", Severity.WARNING),)


def _part(job: Job, machine: MachineProfile, lobe_mm: float, place: str) -> tuple[Finding, ...]:
    """Check the part with half of its lobe, `lobe_mm`, at the `place` along the cut where that is largest."""
    wall_mm, depth_mm = job.wall_thickness_mm, job.depth_of_cut_mm
    left_mm, free_mm = wall_mm - depth_mm - lobe_mm, job.overhang_mm - machine.carriage.jaw_clearance_mm
    speed_rpm, force_n = job.spindle_speed_rpm, job.chucking_force_n
    return (
        _at_most("rule.wall_over_radius", "wall_thickness_mm", wall_mm, job.radius_mm, "mm"),
        _finding(
            "rule.depth_over_wall", "depth_of_cut_mm", left_mm >= LEAST_WALL_MM, left_mm, ">=", LEAST_WALL_MM
        ),
        # The initial surface was turned in this clamping, and is round there. Where the tool is out of it nothing
        # is removed, and the released part keeps that much of its lobe.
        _depth_holds(depth_mm, lobe_mm, place),
        _at_most("rule.length_over_overhang", "cut_length_mm", job.cut_length_mm, free_mm, "mm"),
        _at_most("rule.speed_over_machine", "spindle_speed_rpm", speed_rpm, machine.spindle.max_speed_rpm, "rpm"),
        _at_most("rule.force_over_chuck", "chucking_force_n", force_n, machine.chuck.max_force_n, "N"),
    )


def _depth_holds(depth_mm: float, lobe_mm: float, place: str) -> Finding:
    """Check that the tool cuts all round; the limit is rounded up, so that it is accepted when it is typed."""
    least_mm = math.ceil(round((lobe_mm + LEAST_CHIP_MM) * 1e4, 6)) / 1e4
    value, limit = f"{depth_mm:.6g} mm", f">= {least_mm:.6g} mm{place}"
    problem = Problem(code="rule.depth_under_lobe", key="depth_of_cut_mm", value=value, limit=limit)
    return judge_condition(depth_mm >= least_mm, problem)


def _grip(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    margin_n, need_n = grip_margin_n(job, machine), needed_grip_n(job, machine)
    loss_n, most_n = centrifugal_loss_n(job, machine), MOST_GRIP_LOSS * job.chucking_force_n
    key, warning = "chucking_force_n", Severity.WARNING
    return (
        _finding("rule.grip_margin", key, margin_n >= 0, margin_n, ">=", 0, "N"),
        _finding("rule.grip_need", key, margin_n >= need_n, margin_n, ">=", need_n, "N", warning),
        _at_most("rule.grip_loss", "spindle_speed_rpm", loss_n, most_n, "N"),
    )


def _clamping(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Check the effect of the force; the stress if the material is known and the wall thin enough to bend."""
    material, key, most_um = material_or_none(job.material), "chucking_force_n", job.roundness_tolerance_um
    scatter_n = holding_of(machine).limit_force_sd_fraction * job.chucking_force_n
    scatter_um = lobe_um_per_n(job, machine) * scatter_n
    known = judge_condition(material is not None, unknown_material(job.material), Severity.WARNING)
    scatter = _at_most("rule.clamp_scatter", key, scatter_um, most_um, "um", Severity.WARNING)
    stress_mpa = wall_stress_mpa(job, machine, job.chucking_force_n / job.jaws)
    if material is None or stress_mpa is None:
        return (known, scatter)
    # The limit also gives the force, rounded down, at which the part still springs back.
    most_n = math.floor(job.chucking_force_n * material.yield_mpa / stress_mpa)
    value, limit = f"{stress_mpa:.6g} MPa", f"<= {material.yield_mpa:.6g} MPa ({most_n} N)"
    stress = Problem(code="rule.clamp_stress", key=key, value=value, limit=limit)
    return (known, judge_condition(stress_mpa <= material.yield_mpa, stress), scatter)


def _travel(job: Job, machine: MachineProfile, lobe_mm: float) -> tuple[Finding, ...]:
    """Check that the tool clears the blank and reaches the deepest point of the cut, and the carriage its ends."""
    tool, carriage = machine.tool, machine.carriage
    surface_mm = tool.home_radius_mm - job.radius_mm
    out_mm = surface_mm - tool.retract_mm
    in_mm = surface_mm + job.depth_of_cut_mm + lobe_mm
    start_mm = carriage.jaw_face_mm - job.overhang_mm
    end_mm = start_mm + job.cut_length_mm
    return (
        _check_travel("rule.tool_travel", "diameter_mm", (out_mm, in_mm), tool),
        _check_travel("rule.carriage_travel", "overhang_mm", (start_mm, end_mm), carriage),
    )


def _tool_load(job: Job, machine: MachineProfile, lobe_um: float, place: str) -> tuple[Finding, ...]:
    """Check a sine of the lobe's largest amplitude: thrust |-M w^2 + j B w| A / sqrt(2), acceleration A w^2."""
    tool = machine.tool
    amplitude_m = lobe_um * 1e-6
    most, rpm = tool.encoder_max_acceleration_m_per_s2, job.spindle_speed_rpm

    def force_n(rpm: float) -> float:
        omega = 2 * math.pi * job.jaws * rpm / 60
        return amplitude_m * omega * math.hypot(tool.moving_mass_kg * omega, tool.damping_n_s_per_m) / math.sqrt(2)

    def acceleration(rpm: float) -> float:
        return amplitude_m * (2 * math.pi * job.jaws * rpm / 60) ** 2

    return (
        _at_speed("rule.tool_force", force_n, tool.continuous_force_n, f"N{place}", rpm),
        _at_speed("rule.encoder_acceleration", acceleration, most, f"m/s2{place}", rpm),
    )


def _at_speed(code: str, of_speed: Callable[[float], float], most: float, unit: str, rpm: float) -> Finding:
    """Judge what grows with the speed; the limit of what is too much names the highest whole speed that passes."""
    finding = _at_most(code, "lobe_error_um_pp", of_speed(rpm), most, unit)
    if finding.severity is not Severity.REFUSAL:
        return finding
    slower = bisect_right(range(1, math.ceil(rpm)), most, key=of_speed)
    return replace(finding, problem=replace(finding.problem, limit=f"{finding.problem.limit} ({slower} rpm)"))


def _at_most(
    code: str, key: str, value: float, most: float, unit: str, otherwise: Severity = Severity.REFUSAL
) -> Finding:
    return _finding(code, key, value <= most, value, "<=", most, unit, otherwise)


def _finding(
    code: str,
    key: str,
    holds: bool,
    value: float,
    relation: str,
    bound: float,
    unit: str = "mm",
    otherwise: Severity = Severity.REFUSAL,
) -> Finding:
    problem = Problem(code=code, key=key, value=f"{value:.6g} {unit}", limit=f"{relation} {bound:.6g} {unit}")
    return judge_condition(holds, problem, otherwise)


def _check_travel(code: str, key: str, ends_mm: tuple[float, float], axis: ToolAxis | Carriage) -> Finding:
    low_mm, high_mm = axis.travel_min_mm, axis.travel_max_mm
    value, limit = f"{ends_mm[0]:.6g} … {ends_mm[1]:.6g} mm", f"{low_mm:.6g} … {high_mm:.6g} mm"
    problem = Problem(code=code, key=key, value=value, limit=limit)
    return judge_condition(low_mm <= ends_mm[0] and ends_mm[1] <= high_mm, problem)
