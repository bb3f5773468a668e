"""The slips of the paper: arithmetic that does not hold, and misprints in Prog. 1."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.paper import table_5
from profiles.paper.record import COMPENSATED_UM, Basis, Experiments, Record, Relation, Section

_CONCLUDED_PERCENT = 51.0  # improvement of experiment 1 in the conclusion, section 6
_SECOND_PERCENT = 57.0  # improvement of experiment 2, section 5.2.3
_ACCURACY_UM = 3.0  # Table 3, either way
FASTEST_CLOCK_MHZ, DEFAULT_CLOCK_MHZ = 39.3216, 9.8304
"""Encoder clock of a PMAC2 (its reference manual, I903 and I907): at most one count is taken in a cycle of it."""

_NO_GAIN_DEG = 20.0
"""A path off by this spindle angle leaves the whole lobe of three jaws: |1 - exp(-j 60 deg)| = 1."""

_TURNED_DEG = 10.0  # from which angles are counted, beside jaw 1

_meant = partial(Record, tolerance=1e-9, basis=Basis.CONSTRUCTION, why="meant")
"""The correction of a misprint: it was chosen to give the paper's result."""


def section(paper: Experiments) -> Section:
    """Return the paper's computations beside the correct results."""
    parts = (*_symbols(paper.jobs[0]), *_gains(paper.errors_um_pp), *_program(paper), *_motor(paper.machine))
    return Section("slips", (*parts, *_encoder(paper.machine)))


def _symbols(job: Job) -> tuple[Record, ...]:
    """Return R taken for the diameter, as Table 1 has it, and b1 of a reaction that is periodic."""
    inside_mm = job.radius_mm - job.depth_of_cut_mm
    lost, taken = 1 - (inside_mm / job.radius_mm) ** 3, 1 - (inside_mm / job.diameter_mm) ** 3
    b1 = math.tan(math.radians(3 * _TURNED_DEG))
    size = {"times": taken / lost, "depth_mm": job.depth_of_cut_mm, "diameter_mm": job.diameter_mm}
    return (
        Record("slip.diameter", lost, expected=taken, tolerance=1e-3, why="diameter_as_r", facts=size),
        Record("slip.b1", b1, expected=0.0, tolerance=1e-3, why="periodic", facts={"turned_deg": _TURNED_DEG}),
    )


def _gains(errors_um_pp: tuple[float, float]) -> tuple[Record, ...]:
    (first, second), (kept_first, kept_second) = errors_um_pp, COMPENSATED_UM
    ours_first, lost = 100 * (first - kept_first) / first, second - kept_second
    needed_um = first * (1 - _CONCLUDED_PERCENT / 100)
    concluded = {"percent": _CONCLUDED_PERCENT, "needed_um": needed_um, "fig_16_um": kept_first}
    over_34 = {"percent": _SECOND_PERCENT, "error_um": second}
    of_first = partial(Record, ours=ours_first, unit="%", tolerance=0.5)
    of_second = partial(Record, unit="%", expected=_SECOND_PERCENT)
    put_in: dict[str, Any] = {"basis": Basis.CONSTRUCTION, "why": "put_in"}
    return (
        replace(of_first("slip.gain", at="1", expected=45.0), **put_in),
        of_first("slip.concluded", expected=_CONCLUDED_PERCENT, why="concluded", facts=concluded),
        replace(of_second("slip.gain", 100 * lost / second, at="2", tolerance=0.6), **put_in),
        of_second("slip.over_34", 100 * lost / 34.0, tolerance=0.5, why="over_34", facts=over_34),
    )


def _program(paper: Experiments) -> tuple[Record, ...]:
    machine = paper.machine
    count = {"count_um": machine.tool.count_um}
    way_mm = 10_000 / machine.tool.counts_per_mm
    return (
        Record("slip.product", 55.0 * 0.2, "cts", expected=275.0, why="division", facts=count),
        _meant("slip.quotient", 55.0 / 0.2, "cts", expected=275.0),
        Record("slip.move_time", 1 / (2 * 103 * 50), "ms", expected=10.0, why="exponent"),
        _meant("slip.mended_time", 1 / (2 * 1e-3 * 50), "ms", expected=10.0),
        Record("slip.last_line", way_mm, "mm", expected=-2.0, why="sign", facts={"way_mm": way_mm}),
        _whole_counts(machine, paper.jobs[0]),
    )


def _whole_counts(machine: MachineProfile, job: Job) -> Record:
    """Return the turns it takes to lose `_NO_GAIN_DEG` where every move is truncated to whole counts."""
    counts = machine.spindle.counts_per_rev / (2 * job.jaws)
    lost_deg = 360.0 * 2 * job.jaws * (counts - math.floor(counts)) / machine.spindle.counts_per_rev
    turns = _NO_GAIN_DEG / lost_deg
    facts = {
        "counts": counts,
        "whole": math.floor(counts),
        "lost_deg": lost_deg,
        "off_deg": _NO_GAIN_DEG,
        "seconds": turns * 60.0 / job.spindle_speed_rpm,
    }
    return Record("slip.whole_counts", turns, why="whole_counts", facts=facts)


def _motor(machine: MachineProfile) -> tuple[Record, ...]:
    tool = machine.tool
    current_a = tool.peak_force_n / tool.thrust_constant_n_per_a
    return (
        Record("motor.current", current_a, "A", expected=tool.peak_current_a, tolerance=0.2),
        *_powers(machine),
        Record("motor.constants", tool.thrust_constant_n_per_a / tool.back_emf_v_s_per_m, why="constants"),
        Record("motor.output", tool.peak_current_a / tool.amplifier_gain_a_per_v, "V"),
    )


def _encoder(machine: MachineProfile) -> tuple[Record, ...]:
    """Return what Table 3 allows beside what else the paper states."""
    tool = machine.tool
    stands, lowest_um = tool.encoder_max_acceleration_m_per_s2, min(table_5.AMPLITUDE_ERROR_UM)
    facts = {"default_mhz": DEFAULT_CLOCK_MHZ, "default_m_per_min": 60 * DEFAULT_CLOCK_MHZ * tool.count_um}
    facts |= {"force_n": stands * tool.moving_mass_kg, "least_um": lowest_um}
    most = partial(Record, relation=Relation.AT_MOST, facts=facts)
    counts_mhz = tool.encoder_max_velocity_m_per_min / 60 / tool.count_um
    thrown = tool.peak_force_n / tool.moving_mass_kg
    return (
        most("encoder.counts", counts_mhz, "MHz", expected=FASTEST_CLOCK_MHZ, why="clock"),
        most("encoder.acceleration", thrown, "m/s2", expected=stands, why="thrown"),
        most("encoder.accuracy", _ACCURACY_UM, "um", expected=lowest_um, why="accuracy"),
    )


def _powers(machine: MachineProfile) -> tuple[Record, ...]:
    """Return the copper losses I^2 R at continuous and at peak thrust beside the powers of Table 2."""
    tool = machine.tool
    thrusts = {"continuous": (tool.continuous_force_n, 226.0), "largest": (tool.peak_force_n, 6700.0)}
    squares = {at: (force_n / tool.thrust_constant_n_per_a) ** 2 for at, (force_n, _) in thrusts.items()}
    facts = {f"{at}_ohm": power_w / squares[at] for at, (_, power_w) in thrusts.items()}
    facts["cold_ohm"] = tool.coil_resistance_ohm
    lost = partial(Record, "motor.power", unit="W", why="hot", facts=facts)
    return tuple(
        lost(squares[at] * tool.coil_resistance_ohm, at=at, expected=power_w, tolerance=0.05 * power_w)
        for at, (_, power_w) in thrusts.items()
    )
