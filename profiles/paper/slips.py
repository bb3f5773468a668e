"""The slips of the paper: arithmetic that does not come out, and text of Prog. 1 that says another thing."""

from __future__ import annotations

from profiles.machine import MachineProfile
from profiles.paper.experiments import COMPENSATED_UM, Experiments
from profiles.paper.record import Record, Section

_LOST_COUNTS_A_TURN = 4.0
"""What a driver that cuts F = 1666.67 off to whole counts loses in the six moves of a turn."""

_NO_GAIN_DEG = 20.0
"""A path that is so far off in spindle angle leaves the whole lobe of three jaws: |1 - exp(-j 60 deg)| = 1."""


def section(paper: Experiments) -> Section:
    """Return what the paper computes beside what comes out."""
    records = (*_gains(paper.errors_um_pp), *_program(paper.machine), *_motor(paper.machine))
    return Section(name="slips", records=records)


def _gains(errors_um_pp: tuple[float, float]) -> tuple[Record, ...]:
    (first, second), (kept_first, kept_second) = errors_um_pp, COMPENSATED_UM
    ours_first = 100 * (first - kept_first) / first
    lost = second - kept_second
    return (
        Record(name="slip.gain", at="1", ours=ours_first, unit="%", expected=45.0, tolerance=0.5),
        Record(name="slip.concluded", ours=ours_first, unit="%", expected=51.0, tolerance=0.5, why="concluded"),
        Record(name="slip.gain", at="2", ours=100 * lost / second, unit="%", expected=57.0, tolerance=0.6),
        Record(name="slip.over_34", ours=100 * lost / 34.0, unit="%", expected=57.0, tolerance=0.5, why="over_34"),
    )


def _program(machine: MachineProfile) -> tuple[Record, ...]:
    turns = _NO_GAIN_DEG / (360.0 * _LOST_COUNTS_A_TURN / machine.spindle.counts_per_rev)
    return (
        Record(name="slip.product", ours=55.0 * 0.2, unit="cts", expected=275.0, why="division"),
        Record(name="slip.quotient", ours=55.0 / 0.2, unit="cts", expected=275.0, tolerance=1e-9),
        Record(name="slip.move_time", ours=1 / (2 * 103 * 50), unit="ms", expected=10.0, why="exponent"),
        Record(name="slip.mended_time", ours=1 / (2 * 1e-3 * 50), unit="ms", expected=10.0, tolerance=1e-9),
        Record(
            name="slip.last_line", ours=10_000 / machine.tool.counts_per_mm, unit="mm", expected=-2.0, why="sign"
        ),
        Record(name="slip.whole_counts", ours=turns, unit="", why="whole_counts"),
    )


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
