"""The slips of the paper: arithmetic that does not hold, and misprints in Prog. 1."""

from __future__ import annotations

import math

from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.paper.experiments import COMPENSATED_UM, Experiments
from profiles.paper.record import Record, Section, constructed

_CONCLUDED_PERCENT = 51.0
"""Improvement of experiment 1 in the conclusion, section 6."""

_SECOND_PERCENT = 57.0
"""Improvement of experiment 2, section 5.2.3."""

_NO_GAIN_DEG = 20.0
"""A path off by this spindle angle leaves the whole lobe of three jaws: |1 - exp(-j 60 deg)| = 1."""


def section(paper: Experiments) -> Section:
    """Return the paper's computations beside the correct results."""
    records = (*_gains(paper.errors_um_pp), *_program(paper), *_motor(paper.machine))
    return Section(name="slips", records=records)


def _gains(errors_um_pp: tuple[float, float]) -> tuple[Record, ...]:
    (first, second), (kept_first, kept_second) = errors_um_pp, COMPENSATED_UM
    ours_first = 100 * (first - kept_first) / first
    lost = second - kept_second
    needed_um = first * (1 - _CONCLUDED_PERCENT / 100)
    concluded = {"percent": _CONCLUDED_PERCENT, "needed_um": needed_um, "fig_16_um": kept_first}
    return (
        Record(name="slip.gain", at="1", ours=ours_first, unit="%", expected=45.0, tolerance=0.5),
        Record(
            name="slip.concluded",
            ours=ours_first,
            unit="%",
            expected=_CONCLUDED_PERCENT,
            tolerance=0.5,
            why="concluded",
            facts=concluded,
        ),
        Record(
            name="slip.gain", at="2", ours=100 * lost / second, unit="%", expected=_SECOND_PERCENT, tolerance=0.6
        ),
        Record(
            name="slip.over_34",
            ours=100 * lost / 34.0,
            unit="%",
            expected=_SECOND_PERCENT,
            tolerance=0.5,
            why="over_34",
            facts={"percent": _SECOND_PERCENT, "error_um": second},
        ),
    )


def _program(paper: Experiments) -> tuple[Record, ...]:
    machine = paper.machine
    count = {"count_um": machine.tool.count_um}
    way_mm = 10_000 / machine.tool.counts_per_mm
    return (
        Record(name="slip.product", ours=55.0 * 0.2, unit="cts", expected=275.0, why="division", facts=count),
        _meant("slip.quotient", 55.0 / 0.2, "cts", 275.0),
        Record(name="slip.move_time", ours=1 / (2 * 103 * 50), unit="ms", expected=10.0, why="exponent"),
        _meant("slip.mended_time", 1 / (2 * 1e-3 * 50), "ms", 10.0),
        Record(name="slip.last_line", ours=way_mm, unit="mm", expected=-2.0, why="sign", facts={"way_mm": way_mm}),
        _whole_counts(machine, paper.jobs[0]),
    )


def _meant(name: str, ours: float, unit: str, expected: float) -> Record:
    """Return the correction of a misprint: it was chosen to give the paper's result."""
    return constructed(Record(name=name, ours=ours, unit=unit, expected=expected, tolerance=1e-9), "meant")


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
    return Record(name="slip.whole_counts", ours=turns, unit="", why="whole_counts", facts=facts)


def _motor(machine: MachineProfile) -> tuple[Record, ...]:
    tool = machine.tool
    return (
        Record(
            name="motor.current",
            ours=tool.peak_force_n / tool.thrust_constant_n_per_a,
            unit="A",
            expected=tool.peak_current_a,
            tolerance=0.2,
        ),
        Record(
            name="motor.constants", ours=tool.thrust_constant_n_per_a / tool.back_emf_v_s_per_m, why="constants"
        ),
        Record(name="motor.output", ours=tool.peak_current_a / tool.amplifier_gain_a_per_v, unit="V"),
    )
