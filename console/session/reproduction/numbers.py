"""Acceptance numbers from the simulated lathe: 1 and 5 to 9 of the twelve."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from console.session.reproduction.bench import learned_passes, part_of
from drivers.cutting.findings import steady_moves, stroke
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.true_parameters import ideal
from profiles.cutting import cutting_force
from profiles.materials import material_named
from profiles.paper.causes_left import WITHIN_UM
from profiles.paper.experiments import COMPENSATED_UM, Experiments
from profiles.paper.record import Record, Relation
from profiles.paper.table_5 import with_measured_servo

FULL_S_CURVE_MS, LINEAR_MS = 5, 0
"""TS at which the acceleration time of Prog. 1 is its 10 ms, all of it curved or none."""

CUT_N = 6.0  # steady radial force of the cut; a force in proportion to the depth is then lobed by 1.65 N

AIR, PART = True, False


def uncompensated(paper: Experiments) -> tuple[Record, ...]:
    """Number 1: parts of a plain cut (Fig 14)."""
    records = []
    for number, (job, error) in enumerate(zip(paper.jobs, paper.errors_um_pp, strict=True), start=1):
        part = part_of(job, paper.machine, Strategy.NONE)
        lobe_um = part.roundness.amplitude_um(job.jaws)
        records += [
            _near(1, "lathe.plain", f"{number}", part.roundness.ront_um, error, 0.1, "um"),
            _near(1, "lathe.plain_lobe", f"{number}", lobe_um, error / 2, 0.02, "um"),
        ]
    return tuple(records)


def printed_program(paper: Experiments) -> tuple[Record, ...]:
    """Number 5: Prog. 1 on the controller, with the loop of Table 5 at 50 Hz, and literally with that of Eq 9."""
    measured = with_measured_servo(paper.machine, paper.jobs[0].lobe_frequency_hz)
    curves = (("s_curve", FULL_S_CURVE_MS, (25.2, 15.1)), ("linear", LINEAR_MS, (31.4, 18.8)))
    records = []
    for name, ts_ms, left in curves:
        for number, (job, expected) in enumerate(zip(paper.jobs, left, strict=True), start=1):
            part = part_of(job, measured, Strategy.PAPER, ts_ms)
            records.append(_near(5, f"lathe.{name}", f"{number}", part.roundness.ront_um, expected, 0.3, "um"))
    for number, (job, expected) in enumerate(zip(paper.jobs, COMPENSATED_UM, strict=True), start=1):
        part = part_of(job, paper.machine, Strategy.PAPER)
        speed_rpm = part.spindle_speed_rpm
        lobe_hz = job.jaws * speed_rpm / 60.0
        facts = {"segment_ms": part.plan.segment_ms, "speed_rpm": speed_rpm, "lobe_hz": lobe_hz}
        record = _near(5, "lathe.literal", f"{number}", part.roundness.ront_um, expected, WITHIN_UM, "um")
        records.append(replace(record, why="literal", facts=facts))
    return tuple(records)


def literal_timing(paper: Experiments) -> tuple[Record, ...]:
    """Number 6: TA10 TS10 TM10 executed, experiment 1."""
    job, machine = paper.jobs[0], paper.machine
    part = part_of(job, machine, Strategy.PAPER)
    plan = part.plan
    moves = steady_moves(plan.program, plan.checked, machine)
    low, high = (each - plan.setup.surface for each in stroke(moves, plan.checked, machine))
    return (
        _near(6, "lathe.segment", "", plan.segment_ms, 20.0, 1e-6, "ms"),
        _near(6, "lathe.speed", "", part.spindle_speed_rpm, 500.0, 0.01, "rpm"),
        _near(6, "lathe.lobe_frequency", "", job.jaws * part.spindle_speed_rpm / 60.0, 25.0, 0.005, "Hz"),
        _near(6, "lathe.stroke", "", high - low, 183.3, 0.1, "cts"),
        _near(6, "lathe.mean", "", (high + low) / 2, 637.5, 0.1, "cts"),
    )


def inverse(paper: Experiments) -> tuple[Record, ...]:
    """Number 7: inverse feedforward, the plant as its profile says, quantisation on."""
    (cut,) = learned_passes(paper.jobs[0], paper.machine, ideal(paper.machine), [PART])
    parts = (part_of(job, paper.machine, Strategy.CAM).roundness.ront_um for job in paper.jobs)
    return (
        _most(7, "lathe.lobe", "", cut.lobe_um_pp, 0.05),
        _most(7, "lathe.places", "", cut.places_um_pp, 0.3),
        *(Record(number=7, name="lathe.ours", at=f"{n}", ours=ront, unit="um") for n, ront in enumerate(parts, 1)),
    )


def wrong_plant(paper: Experiments) -> tuple[Record, ...]:
    """Number 8: a mass that is 10 % more and a gain that is 10 % less than the profile says."""
    as_said = ideal(paper.machine)
    true = replace(as_said, moving_mass_kg=1.1 * as_said.moving_mass_kg, force_n_per_v=0.9 * as_said.force_n_per_v)
    passes = learned_passes(paper.jobs[0], paper.machine, true, [AIR] * 4)
    limits_um = (10.0, 2.0, 0.5, 0.1)
    return tuple(
        _most(8, "lathe.pass", f"{number}", each.lobe_um_pp, limit)
        for number, (each, limit) in enumerate(zip(passes, limits_um, strict=True))
    )


def friction(paper: Experiments) -> tuple[Record, ...]:
    """Number 9: mass 5 % more, 3 N of dry friction, 0.3 um of encoder noise, a cut of 6 N."""
    job, machine = paper.jobs[0], paper.machine
    as_said = ideal(machine)
    main_n = cutting_force(material_named(job.material), job.depth_of_cut_mm, job.feed_mm_per_rev).main_n
    true = replace(
        as_said,
        moving_mass_kg=1.05 * as_said.moving_mass_kg,
        coulomb_friction_n=3.0,
        encoder_noise_um=0.3,
        passive_fraction=CUT_N / main_n,
    )
    (unlearned,) = learned_passes(job, machine, true, [PART])
    *_, first, second, third = learned_passes(job, machine, true, [AIR] * 3 + [PART] * 3)
    return (
        _most(9, "lathe.unlearned", "", unlearned.averaged_um_pp, 18.0),
        _most(9, "lathe.cut", "1", first.lobe_um_pp, 5.0),
        _most(9, "lathe.cut", "2", second.lobe_um_pp, 1.2),
        _most(9, "lathe.cut", "3", third.lobe_um_pp, 0.5),
        _most(9, "lathe.averaged", "", third.averaged_um_pp, 1.5),
    )


NUMBERS: Mapping[int, Callable[[Experiments], tuple[Record, ...]]] = {
    1: uncompensated,
    5: printed_program,
    6: literal_timing,
    7: inverse,
    8: wrong_plant,
    9: friction,
}
"""Function that computes each number."""


def _near(number: int, name: str, at: str, ours: float, expected: float, tolerance: float, unit: str) -> Record:
    return Record(number=number, name=name, at=at, ours=ours, expected=expected, tolerance=tolerance, unit=unit)


def _most(number: int, name: str, at: str, ours: float, limit: float) -> Record:
    return Record(number=number, name=name, at=at, ours=ours, expected=limit, relation=Relation.AT_MOST, unit="um")
