"""Eqs 5 to 7 and Table 6: what the symbols of the depth of cut mean, and what the conditions leave open."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from profiles.axis.servo import tool_compliance_um_per_n
from profiles.chucking.reaction import Reaction, eq3_um
from profiles.chucking.ring import Ring, spring_back_um_pp
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.paper.chuck import LENGTH_MM, RATIO, RPM, SWINGING
from profiles.paper.experiments import Experiments
from profiles.paper.record import Basis, Record

_TURN_DEG = np.arange(0.0, 360.0)
_TA_MS, _TS_MS, _TM_MS = 10.0, 10.0, 10.0  # of Prog. 1
_MOVES = 6  # of Prog. 1 in a turn


def equation_records() -> tuple[Record, ...]:
    """Return Eq 6 with the constants of Eq 5 beside Eq 3, and A0 of Eq 5 beside the A0 of Eq 7."""
    a0_um, a1_um, b1_um = _eq5_um(SWINGING)
    phase = 3 * np.radians(_TURN_DEG)
    eq6_um = a0_um + a1_um * np.sin(phase) - b1_um * np.cos(phase)
    printed = replace(SWINGING, exponent=None)
    # Rounding differs from one computer to the next.
    off_um = round(float(np.abs(eq6_um - eq3_um(printed, RPM, _TURN_DEG, RATIO)).max()), 9)
    same = Record("eq6.off", off_um, "um", expected=0.0, tolerance=1e-6, basis=Basis.CONSTRUCTION, why="eq6")
    return same, Record("eq5.a0", a0_um, "um", expected=100.0, tolerance=1.0, why="a0")


def table_6_records(paper: Experiments) -> tuple[Record, ...]:
    """Return what Table 6 implies and what it does not state."""
    (first, second), (first_um, second_um) = paper.jobs, paper.errors_um_pp
    alike = _ring_um_per_n(second) / _ring_um_per_n(first)
    forces = [um / _ring_um_per_n(job) for job, um in zip(paper.jobs, paper.errors_um_pp, strict=True)]
    ring = {"alike": alike, "force_ratio": forces[1] / forces[0], "first_n": forces[0], "second_n": forces[1]}
    of_depth = second_um / second.depth_of_cut_mm / (first_um / first.depth_of_cut_mm)
    segment_ms = max(_TM_MS, _TA_MS, 2 * _TS_MS)
    return (
        Record("table6.of_depth", of_depth, why="of_depth"),
        Record(
            "table6.ring", alike, expected=second_um / first_um, tolerance=0.05, why="force_unstated", facts=ring
        ),
        Record(
            "table6.speed",
            60_000 / (_MOVES * segment_ms),
            "rpm",
            expected=first.spindle_speed_rpm,
            why="literal_speed",
            facts={"segment_ms": segment_ms},
        ),
        _held_depth(paper.machine, first),
    )


def _eq5_um(reaction: Reaction) -> tuple[float, float, float]:
    """Return A0, A1 and B1 of Eq 5, um, term by term as printed."""
    omega = 2 * math.pi * RPM / 60
    lobe = 1e6 * (1 - RATIO**3) / (omega * reaction.damping_n_s_per_m)
    mean = 1e6 * 3 * reaction.a_n[0] / (2 * reaction.stiffness_n_per_m) * (1 - RATIO)
    return mean, lobe * reaction.a_n[1], lobe * reaction.b_n[0]


def _ring_um_per_n(job: Job) -> float:
    """Return the lobe of a part as a ring, um p-p for one newton on each jaw."""
    material = material_named("Al")
    ring = Ring(outside_mm=job.diameter_mm, wall_mm=job.wall_thickness_mm, length_mm=LENGTH_MM, material=material)
    return spring_back_um_pp(ring, 3, 1.0)


def _held_depth(machine: MachineProfile, job: Job) -> Record:
    """Return how far the cut of experiment 1 pushes the tool out of its depth before the integrator acts."""
    passive_n = cutting_force(material_named("Al"), job.depth_of_cut_mm, job.feed_mm_per_rev).passive_n
    slow = replace(machine, tool=replace(machine.tool, gain_ki_v_per_m_s=0.0))
    yields = abs(complex(tool_compliance_um_per_n(slow, 0.0)))
    tool = machine.tool
    facts = {
        "force_n": passive_n,
        "um_per_n": yields,
        "recovery_s": tool.gain_kp_v_per_m / tool.gain_ki_v_per_m_s,
        "feed_mm_per_rev": job.feed_mm_per_rev,
    }
    of = partial(Record, expected=0.0, tolerance=1.0, why="held_depth", facts=facts)
    return of("table6.held", yields * passive_n, "um")
