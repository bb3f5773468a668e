"""The following error as the tool moves out at the end of a cut, by the machine's own figures.

Four errors add up there: that of the lobe, largest where a cut ends next to the jaws; that of the motion, nearly
half a sine of speed; that of the force of the cut, which ends while the loop still pushes against it; and that of
dry friction. A compensation table keeps the lobe at full amplitude until the tool is out; a program of segments
fades it out. Of a table this was within -5 and +20 um of simulated cuts.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from profiles.arrays import Floats
from profiles.axis.servo import following_error_um, pushed_um_per_n, sampled_response
from profiles.axis.servo_gains import error_limit_um
from profiles.axis.stiffness import USUAL_FRICTION_N
from profiles.cutting import PASSIVE_FRACTION, cutting_force
from profiles.findings import Finding, Severity, judge_condition
from profiles.job import Job
from profiles.lobe.along import along_cut, longest_shorter_mm, with_lengths
from profiles.machine import MachineProfile
from profiles.materials import material_or_none
from profiles.problem import Problem

OUT_SPEED_MM_S = 10.0  # peak speed of every program's way between its depth and the retracted position


def out_ms(way_mm: float) -> float:
    """Return the duration of a cubic of such a length from rest to rest, at its peak speed."""
    return 1.5 * way_mm / OUT_SPEED_MM_S * 1000.0


def moving_out_um(job: Job, machine: MachineProfile) -> tuple[float, float]:
    """Return the largest following error of a tool that moves out on a table, and of one whose lobe fades out.

    The force is that of the predicted cut, good to about 50 %; none of an unknown material. It ends as the tool
    leaves its depth. Dry friction counts as it does in the mean of a motion with a sine on top (a relay with a
    bias, Gelb and Vander Velde 1968).
    """
    along, way_mm = along_cut(job, machine), machine.tool.retract_mm + job.depth_of_cut_mm
    ends_um = job.lobe_amplitude_um * abs(float(along.factor(job.jaws, along.half_length_mm)))
    lobe_um = ends_um * float(np.abs(1.0 / sampled_response(machine, job.lobe_frequency_hz) - 1.0))
    lobe_mm_s = 2.0 * math.pi * job.lobe_frequency_hz * ends_um / 1000.0
    t = np.linspace(0.0, 1.0, 51)[1:-1]  # of the way out
    gone, speed, hz = t**2 * (3.0 - 2.0 * t), 4.0 * t * (1.0 - t), 500.0 / out_ms(way_mm)
    motion_um = speed * following_error_um(machine, 1000.0 * OUT_SPEED_MM_S / (2.0 * math.pi * hz), hz)
    ended_n = _passive_n(job, machine) * np.minimum(way_mm * gone / job.depth_of_cut_mm, 1.0)
    yields_um_per_n = pushed_um_per_n(machine, t / (2.0 * hz))

    def most_um(amplitude: Floats) -> float:
        mean = np.arcsin(speed / np.maximum(speed, amplitude * lobe_mm_s / OUT_SPEED_MM_S)) * 2.0 / math.pi
        steps_n = np.diff(ended_n + USUAL_FRICTION_N * mean, prepend=0.0)
        pushed_um = np.convolve(steps_n, yields_um_per_n)[: t.size]
        return float(np.max(lobe_um * amplitude + motion_um + pushed_um))

    return most_um(np.ones_like(t)), most_um(1.0 - gone)


def _passive_n(job: Job, machine: MachineProfile) -> float:
    material, fraction = material_or_none(job.material), machine.tool.passive_force_fraction or PASSIVE_FRACTION
    if material is None:
        return 0.0
    force = cutting_force(material, job.depth_of_cut_mm, job.feed_mm_per_rev, passive_fraction=fraction)
    return force.passive_n


def moving_out_findings(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return `rule.moving_out`: a table trips the following error limit, with the shorter cut that does not."""
    limit_um = error_limit_um(machine)
    table_um, faded_um = moving_out_um(job, machine)
    if not 0.0 < limit_um <= table_um:  # 0 is no limit
        return ()

    def passes(length_mm: float) -> bool:
        return moving_out_um(replace(job, cut_length_mm=length_mm), machine)[0] < limit_um

    value, limit = f"{table_um:.0f} um", f"< {limit_um:g} um"
    problem = Problem(
        code="rule.moving_out", key="cut_length_mm", value=value, where=f"{faded_um:.0f} um", limit=limit
    )
    problem = with_lengths(problem, longest_shorter_mm(job.cut_length_mm, passes))
    return (judge_condition(False, problem, Severity.WARNING),)
