"""Eqs 4 to 11 without 9, Prog. 1, Table 6, Figs 14 and 16: parts before and after, what is left, what is open."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from profiles.arrays import floats
from profiles.axis.servo import tool_compliance_um_per_n
from profiles.chucking.ring import Ring, spring_back_um_pp
from profiles.compensations.path import compensated_depth_um, removed_depth_um, spindle_speed_rpm
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.paper.causes_left import (
    FULL_BLEND,
    SINE,
    Ramps,
    cause_records,
    fundamental_fraction,
    left_um,
    models,
    stroke_fraction,
    zigzag,
)
from profiles.paper.chuck import LENGTH_MM, RATIO, RPM, SWINGING, Reaction, eq3_um
from profiles.paper.record import Basis, Curve, Experiments, Figure, Record, Section
from profiles.roundness import evaluate

_TURN_DEG = np.arange(0.0, 360.0, 0.5)
_PHASE = np.radians(3 * _TURN_DEG)
_WHOLE_DEG = np.arange(0.0, 360.0)
_TA_MS, _TS_MS, _TM_MS = 10.0, 10.0, 10.0  # of Prog. 1
_MOVES = 6  # of Prog. 1 in a turn

_put_in = partial(Record, tolerance=1e-9, basis=Basis.CONSTRUCTION, why="put_in")
"""A record whose numbers come from the paper itself."""


def equation_records() -> tuple[Record, ...]:
    """Return Eq 6 with the constants of Eq 5 beside Eq 3, and A0 of Eq 5 beside the A0 of Eq 7."""
    a0_um, a1_um, b1_um = _eq5_um(SWINGING)
    phase = 3 * np.radians(_WHOLE_DEG)
    eq6_um = a0_um + a1_um * np.sin(phase) - b1_um * np.cos(phase)
    printed = replace(SWINGING, exponent=None)
    # Rounding differs from one computer to the next.
    off_um = round(float(np.abs(eq6_um - eq3_um(printed, RPM, _WHOLE_DEG, RATIO)).max()), 9)
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


def section(paper: Experiments) -> Section:
    """Return the comparison of the trajectories and of the parts."""
    return Section(
        "parts",
        (
            *_path(paper),
            *equation_records(),
            *_prog_1(paper),
            *table_6_records(paper),
            *_fig_14(paper),
            *cause_records(paper),
        ),
        (_figure_prog_1(paper), *_figures_14_and_16(paper)),
    )


def _path(paper: Experiments) -> tuple[Record, ...]:
    first, second = paper.jobs
    deepest = compensated_depth_um(_TURN_DEG, a0_um=100.0, a1_um=27.5)
    per_mm, of = paper.machine.tool.counts_per_mm, partial(_put_in, unit="cts")
    return (
        _put_in("eq4.speed", spindle_speed_rpm(50.0, 3), "rpm", expected=1000.0),
        _put_in("eq7.amplitude", first.lobe_amplitude_um, "um", expected=27.5, at="1"),
        _put_in("eq7.amplitude", second.lobe_amplitude_um, "um", expected=16.5, at="2"),
        _put_in("eq11.deepest", float(deepest.max()), "um", expected=127.5),
        of("prog1.depth", first.depth_of_cut_mm * per_mm, at="1", expected=500.0),
        of("prog1.depth", second.depth_of_cut_mm * per_mm, at="2", expected=300.0),
        of("prog1.counts", paper.errors_um_pp[0] / 1000 * per_mm, at="1", expected=275.0),
        of("prog1.counts", paper.errors_um_pp[1] / 1000 * per_mm, at="2", expected=165.0),
        of("prog1.sixth", paper.machine.spindle.counts_per_rev / (2 * first.jaws), expected=10_000 / 6),
    )


def _prog_1(paper: Experiments) -> tuple[Record, ...]:
    error_um = paper.errors_um_pp[0]
    stroke = partial(Record, "prog1.stroke", unit="um", expected=error_um, why="stroke")
    ramps = {"s_curve": (Ramps.S_CURVE, FULL_BLEND), "linear": (Ramps.LINEAR, FULL_BLEND)}
    blends = ramps | {"triangle": (Ramps.LINEAR, 0.0)}
    mean = partial(Record, "prog1.mean", unit="um", why="mean")
    depths_um = [1000 * job.depth_of_cut_mm for job in paper.jobs]
    return (
        *(stroke(error_um * stroke_fraction(*each), at=name) for name, each in ramps.items()),
        *(
            Record("prog1.fundamental", 100 * fundamental_fraction(zigzag(*each)), "%", at=name)
            for name, each in blends.items()
        ),
        *(
            mean(depth_um + error / 2, at=f"{number}", expected=depth_um)
            for number, (depth_um, error) in enumerate(zip(depths_um, paper.errors_um_pp, strict=True), start=1)
        ),
    )


def _fig_14(paper: Experiments) -> tuple[Record, ...]:
    records = []
    for number, (job, error) in enumerate(zip(paper.jobs, paper.errors_um_pp, strict=True), start=1):
        removed = removed_depth_um(_TURN_DEG, a0_um=1000 * job.depth_of_cut_mm, a1_um=job.lobe_amplitude_um)
        round_um = evaluate(_TURN_DEG, -removed, None).ront_um
        records.append(_put_in("fig14.ront", round_um, "um", expected=error, at=f"{number}", tolerance=0.01))
    return tuple(records)


def _figure_prog_1(paper: Experiments) -> Figure:
    error_um = paper.errors_um_pp[0]
    paths = {"wanted": dict(SINE), "s_curve": zigzag(Ramps.S_CURVE, 1.0), "linear": zigzag(Ramps.LINEAR, 1.0)}
    curves = []
    for name, harmonics in paths.items():
        each_um = [error_um * fraction * np.cos(k * _PHASE) for k, fraction in harmonics.items()]
        curves.append(Curve(name, _TURN_DEG, floats(np.sum(each_um, axis=0))))
    return Figure("prog1", "deg", "um", tuple(curves))


def _figures_14_and_16(paper: Experiments) -> tuple[Figure, ...]:
    model, figures = models(paper)["s_curve_measured"], []
    for number, error in enumerate(paper.errors_um_pp, start=1):
        before = Curve("before", _TURN_DEG, error / 2 * np.cos(_PHASE))
        after = Curve("after", _TURN_DEG, left_um(error, *model, _PHASE))
        figures.append(Figure("fig16", "deg", "um", (before, after), at=f"{number}"))
    return tuple(figures)
