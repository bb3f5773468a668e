"""The behaviour of a job's cut: force, copying, the effect of a lobed blank on the tool, chatter."""

from __future__ import annotations

from dataclasses import dataclass

from profiles.axis.servo import tool_compliance_um_per_n
from profiles.chucking.held_part import HeldPart, held_part
from profiles.chucking.ring import THIN_WALL
from profiles.cutting import Copying, CuttingForce, copying, nearest_mode, radial_cutting_stiffness_n_per_mm2
from profiles.cutting import chatter_limit_mm as limit_mm
from profiles.findings import Finding, Severity, judged
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

NEAR_BORDER = 0.1  # relative distance of a wall from the border between ring and bar within which it may be either


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingProcess:
    """The process of one cut.

    `lobed_force_n` is the amplitude of the radial force on a blank as lobed as the predicted error, and
    `lobed_motion_um` the tool's deflection by it at the lobe frequency. `chatter_limit_mm` is the width of cut
    below which nothing chatters; `work_n_per_um` is the part where it is softest.
    """

    force: CuttingForce
    copying: Copying
    lobed_force_n: float
    lobed_motion_um: float
    work_n_per_um: float
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
        work_n_per_um=part.softest_n_per_um,
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
    return (*_lifted(part), _border(part), *_mode(part, machine))


def _lifted(part: HeldPart) -> tuple[Finding, ...]:
    if part.thin:
        return ()
    value, limit = f"{part.force.passive_n:.6g} N", f"{part.per_jaw_n:.6g} N"
    lifts = Problem(code="rule.jaw_lifts", key="overhang_mm", value=value, limit=limit)
    return (judged(not part.lifted(), lifts, Severity.WARNING),)


def _border(part: HeldPart) -> Finding:
    """Warn near the border of the two models: a wall may be either, and their errors differ many times."""
    wall_mm, border_mm = part.job.wall_thickness_mm, THIN_WALL * part.job.radius_mm
    value, limit = f"{wall_mm:.6g} mm", f"{border_mm:.6g} mm"
    near = Problem(code="rule.wall_border", key="wall_thickness_mm", value=value, limit=limit)
    return judged(abs(wall_mm / border_mm - 1.0) > NEAR_BORDER, near, Severity.WARNING)


def _mode(part: HeldPart, machine: MachineProfile) -> tuple[Finding, ...]:
    mode_hz = machine.chuck.work_mode_hz
    if mode_hz is None:
        return ()
    found = nearest_mode(part.job.lobe_frequency_hz, (mode_hz,))
    value = f"{part.job.lobe_frequency_hz * (found[0] if found else 1):.6g} Hz"
    near = Problem(code="rule.mode_near", key="spindle_speed_rpm", value=value, limit=f"{mode_hz:.6g} Hz")
    return (judged(found is None, near, Severity.WARNING),)
