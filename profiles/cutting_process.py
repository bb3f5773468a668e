"""The behaviour of a job's cut: force, copying, the effect of a lobed blank on the tool, chatter."""

from __future__ import annotations

from dataclasses import dataclass

from profiles.axis.servo import tool_compliance_um_per_n
from profiles.chucking.held_part import HeldPart, held_part
from profiles.chucking.ring import THIN_WALL
from profiles.cutting import CuttingForce, ErrorCopying, copying, nearest_mode, radial_cutting_stiffness_n_per_mm2
from profiles.cutting import chatter_limit_mm as limit_mm
from profiles.findings import Finding, Severity, judge_condition
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

NEAR_BORDER = 0.1  # relative distance of a wall from the border between ring and bar within which it may be either


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingProcess:
    """The process of one cut.

    `lobed_force_n` is the amplitude of the radial force on a blank as lobed as the predicted error, and
    `lobed_motion_um` the tool's deflection by it at the lobe frequency. `chatter_limit_mm` is the width of cut
    below which nothing chatters.
    """

    force: CuttingForce
    copying: ErrorCopying
    lobed_force_n: float
    lobed_motion_um: float
    chatter_limit_mm: float


def cutting_process(part: HeldPart, machine: MachineProfile, error_um_pp: float) -> CuttingProcess:
    """Return the process for a part whose blank is lobed by `error_um_pp`."""
    job, force = part.job, part.force
    cut_n_per_um = force.passive_n / (1000 * job.depth_of_cut_mm)
    tool_um_per_n = abs(complex(tool_compliance_um_per_n(machine, job.lobe_frequency_hz)))
    lobed_n = cut_n_per_um * error_um_pp / 2
    return CuttingProcess(
        force=force,
        copying=copying(cut_n_per_um, 1 / (tool_um_per_n + part.compliance_um_per_n)),
        lobed_force_n=lobed_n,
        lobed_motion_um=lobed_n * tool_um_per_n,
        chatter_limit_mm=_width_without_chatter_mm(part),
    )


def chatter_limit_mm(job: Job, machine: MachineProfile) -> float:
    """Return the width of cut below which the part of a job does not chatter, at its point of least stiffness.

    Fast enough for every key. Raises `ProfileError` (`rule.material_unknown`).
    """
    return _width_without_chatter_mm(held_part(job, machine))


def _width_without_chatter_mm(part: HeldPart) -> float:
    radial = radial_cutting_stiffness_n_per_mm2(part.material, part.job.feed_mm_per_rev)
    return limit_mm(part.softest_n_per_um, part.damping_ratio, radial)


def process_findings(part: HeldPart, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return the findings about the process, beside those of `profiles.rules`.

    - `rule.jaw_lifts`      (warning) a jaw edge that loses contact with a bar under the cut
    - `rule.wall_border`    (warning) a wall within 10 % of where a ring that bends becomes a bar
    - `rule.mode_near`      (warning) one, two or three times the lobe frequency within 10 % of a mode of the part
    """
    job, mode_hz, findings = part.job, machine.chuck.work_mode_hz, []

    def warn_unless(holds: bool, code: str, key: str, value: str, limit: str) -> None:
        problem = Problem(code=code, key=key, value=value, limit=limit)
        findings.append(judge_condition(holds, problem, Severity.WARNING))

    if not part.thin:
        value, limit = f"{part.force.passive_n:.6g} N", f"{part.per_jaw_n:.6g} N"
        warn_unless(not part.lifted(), "rule.jaw_lifts", "overhang_mm", value, limit)
    # Near the border of the two models a wall may be either, and their errors differ many times.
    wall_mm, border_mm = job.wall_thickness_mm, THIN_WALL * job.radius_mm
    clear, value = abs(wall_mm / border_mm - 1.0) > NEAR_BORDER, f"{wall_mm:.6g} mm"
    warn_unless(clear, "rule.wall_border", "wall_thickness_mm", value, f"{border_mm:.6g} mm")
    if mode_hz is not None:
        found = nearest_mode(job.lobe_frequency_hz, (mode_hz,))
        value = f"{job.lobe_frequency_hz * (found[0] if found else 1):.6g} Hz"
        warn_unless(found is None, "rule.mode_near", "spindle_speed_rpm", value, f"{mode_hz:.6g} Hz")
    return tuple(findings)
