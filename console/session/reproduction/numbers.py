"""Acceptance numbers from a simulated lathe in this process: 1 and 5 to 9 of the twelve."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from console.session.cut.in_process import simulated_context
from console.session.cut.run import CutObserver, CutOutcome, cut_part
from console.session.learning.learning_beside import AirWatch
from console.session.stages import AIR_MM, nominal_path
from drivers.cutting.findings import steady_moves, stroke
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response
from drivers.lathe.heartbeat import cut_condition
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.true_parameters import TrueParameters, as_simulated, ideal
from profiles.compensations.learning import fit_harmonics, learned_command
from profiles.compensations.path import CutPath, LobedPath
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.least_squares import fit, harmonic_columns
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.paper.causes_left import WITHIN_UM
from profiles.paper.record import COMPENSATED_UM, Basis, Experiments, Record, Relation
from profiles.paper.table_5 import with_measured_servo
from profiles.roundness import RoundnessResult, evaluate

FULL_S_CURVE_MS, LINEAR_MS = 5, 0
"""TS at which the acceleration time of Prog. 1 is its 10 ms, all of it curved or none."""

CUT_N = 6.0  # steady radial force of the cut; a force in proportion to the depth is then lobed by 1.65 N

AIR, PART = True, False
CUT_MM = 1.5
"""Thirty turns of the paper's jobs: the part is measured in the middle, and is the same in a longer cut."""

HARMONICS = tuple(range(1, 16))  # orders from which an average turn is built
OVERTONES = 3
DRIFT_POWERS = 3
"""A compliant axis drifts back to its depth while it cuts; that is size and taper, no roundness: removed first."""

Floats = NDArray[np.float64]


class Bench:
    """One lathe. Parts are cut on it one after another; it is homed for the first."""

    def __init__(self, machine: MachineProfile, true: TrueParameters | None = None) -> None:
        """Take `true`, the actual hardware; None for one as its profile says."""
        self.machine = machine = as_simulated(machine, true)
        self._context, self._simulated = simulated_context(machine, true)
        self.lathe = self._context.lathe
        self._homed = False

    def plan(
        self,
        job: Job,
        strategy: Strategy,
        ts_ms: int | None = None,
        *,
        path: CutPath | None = None,
        air_mm: float = 0.0,
    ) -> CutPlan:
        """Plan a cut from the whole turn nearest to the spindle position."""
        turn, watchdog = 0, cut_condition(self.machine)
        if self._homed:
            turn = round(self.lathe.snapshot().spindle.position / self.machine.spindle.counts_per_rev)
        return plan_cut(
            job, self.machine, strategy, ts_ms, from_turn=turn, watchdog=watchdog, path=path, air_mm=air_mm
        )

    def cut(self, job: Job, plan: CutPlan, beside: CutObserver | None = None, *, air: bool = False) -> CutOutcome:
        """Cut a part, or in air.

        Raises:
            ProblemError: what went wrong.
        """
        outcome = cut_part(self._context, job, plan, lambda *_: None, beside, homed=self._homed, blank=not air)
        self._homed = True
        return outcome

    def true_position(self) -> tuple[float, float]:
        """Return the true positions of tool and spindle, counts, finer than the encoders resolve."""
        motors = self._simulated.controller.motors
        return motors[self.machine.tool.motor].true_position, motors[self.machine.spindle.motor].true_position


def cut_and_measure(
    job: Job, machine: MachineProfile, strategy: Strategy, ts_ms: int | None = None
) -> tuple[CutPlan, float, RoundnessResult]:
    """Cut a part on a new lathe that is as its profile says; return plan, speed, rpm, and unfiltered roundness."""
    bench, short = Bench(machine), replace(job, cut_length_mm=CUT_MM)
    plan = bench.plan(short, strategy, ts_ms)
    outcome = bench.cut(short, plan)
    assert outcome.trace is not None  # the rig measures
    roundness = evaluate(outcome.trace.angle_deg, outcome.trace.deviation_um, None)
    return plan, outcome.figures.spindle_speed_rpm, roundness


@dataclass(frozen=True, kw_only=True)
class Pass:
    """Tool error of one pass, um peak to peak.

    `lobe_um_pp` is the harmonic of the lobe, by the scale; `averaged_um_pp` an average turn without its
    eccentricity; `places_um_pp` all true positions.
    """

    lobe_um_pp: float
    averaged_um_pp: float
    places_um_pp: float


def learned_passes(
    job: Job, machine: MachineProfile, true: TrueParameters, in_air: Sequence[bool]
) -> tuple[Pass, ...]:
    """Return the passes on one lathe, each in air or in a new blank, and each corrected by those before.

    The first has the inverse of the profile's servo. Between two passes the error of the lobe and of its
    overtones goes into the command with gain 1 through that same inverse; the part is never measured for it.
    """
    bench, short = Bench(machine, true), replace(job, cut_length_mm=CUT_MM)
    path = nominal_path(job, machine, Strategy.CAM)

    def response(order: int) -> complex:
        return nominal_response(Strategy.CAM, machine, order * job.spindle_speed_rpm / 60.0)

    passes = []
    for air in in_air:
        plan = bench.plan(short, Strategy.CAM, path=path, air_mm=AIR_MM + job.depth_of_cut_mm if air else 0.0)
        watch = _PassWatch(bench, plan, path.target, job.jaws)
        bench.cut(short, plan, watch, air=air)
        found = watch.harmonics_um()
        passes.append(
            Pass(
                lobe_um_pp=2.0 * abs(found[job.jaws]),
                averaged_um_pp=_turn_um_pp(found),
                places_um_pp=watch.places_um_pp(),
            )
        )
        learnable = {job.jaws * k: found[job.jaws * k] for k in range(1, OVERTONES + 1)}
        path = learned_command(path, learnable, response)
    return tuple(passes)


def _turn_um_pp(found: Mapping[int, complex]) -> float:
    """Return the peak to peak of an average turn; one undulation per revolution only shifts the part."""
    around = np.radians(np.arange(0.0, 360.0, 0.5))
    return float(np.ptp(np.sum([np.real(c * np.exp(1j * n * around)) for n, c in found.items() if n > 1], axis=0)))


def _steady(angle_deg: Floats, error_um: Floats) -> Floats:
    """Return the error without its drift."""
    fed = (angle_deg - angle_deg[0]) / np.ptp(angle_deg)
    drift = (fed**power for power in range(1, DRIFT_POWERS + 1))
    return fit(harmonic_columns(fed, (), *drift), error_um).residuals


class _PassWatch(AirWatch):
    """Gather one batch of a pass, and sample the true position while the tool is on its path."""

    def __init__(self, bench: Bench, plan: CutPlan, target: LobedPath, lobes: int) -> None:
        super().__init__(bench.lathe, lobes)
        self._bench, self._plan, self._target = bench, plan, target
        self._true_positions: list[tuple[float, float]] = []

    def see(self, snapshot: Snapshot) -> None:
        setup = self._plan.setup
        fed = snapshot.carriage.position - self._plan.carriage_start
        # Two turns at each end are left out: the tool may still be moving in or out.
        clear = 2.0 * setup.carriage_per_turn
        steady = clear < fed < setup.carriage_counts - clear and snapshot.tool.position > setup.surface
        if snapshot.program_running and steady:
            self._true_positions.append(self._bench.true_position())
        super().see(snapshot)

    def harmonics_um(self) -> dict[int, complex]:
        """Return by order how much too far out the tool was, by its scale."""
        batch = self._batches[-1]
        error_um = self._target.at_um(batch.angle_deg, batch.past_middle_mm) - batch.infeed_um
        steady_um = _steady(batch.angle_deg, error_um)
        return dict(fit_harmonics(batch.angle_deg, steady_um, HARMONICS).coefficients_um)

    def places_um_pp(self) -> float:
        """Return the same of the true positions, over all samples: peak to peak."""
        machine, (tool, spindle) = self._bench.machine, np.array(self._true_positions).T
        angle_deg = spindle / machine.spindle.counts_per_rev * 360.0
        infeed_um = (tool - self._plan.setup.surface) * machine.tool.count_um
        return float(np.ptp(_steady(angle_deg, self._target.at_um(angle_deg) - infeed_um)))


def compare_uncompensated_parts(paper: Experiments) -> tuple[Record, ...]:
    """Number 1: parts of a plain cut (Fig 14)."""
    records = []
    for number, (job, error) in enumerate(zip(paper.jobs, paper.errors_um_pp, strict=True), start=1):
        *_, roundness = cut_and_measure(job, paper.machine, Strategy.NONE)
        lobe_um = roundness.amplitude_um(job.jaws)
        records += [
            _number_near(1, "lathe.plain", f"{number}", roundness.ront_um, error, 0.1, "um"),
            _number_near(1, "lathe.plain_lobe", f"{number}", lobe_um, error / 2, 0.02, "um"),
        ]
    return tuple(replace(each, basis=Basis.CONSTRUCTION, why="put_in") for each in records)


def printed_program(paper: Experiments) -> tuple[Record, ...]:
    """Number 5: Prog. 1 on the controller, with the loop of Table 5 at 50 Hz, and literally with that of Eq 9."""
    measured = with_measured_servo(paper.machine, paper.jobs[0].lobe_frequency_hz)
    curves = (("s_curve", FULL_S_CURVE_MS, (25.2, 15.1)), ("linear", LINEAR_MS, (31.4, 18.8)))
    records = []
    for name, ts_ms, left in curves:
        for number, (job, expected) in enumerate(zip(paper.jobs, left, strict=True), start=1):
            *_, roundness = cut_and_measure(job, measured, Strategy.PAPER, ts_ms)
            record = _number_near(5, f"lathe.{name}", f"{number}", roundness.ront_um, expected, 0.3, "um")
            records.append(replace(record, basis=Basis.READING))
    for number, (job, expected) in enumerate(zip(paper.jobs, COMPENSATED_UM, strict=True), start=1):
        plan, speed_rpm, roundness = cut_and_measure(job, paper.machine, Strategy.PAPER)
        lobe_hz = job.jaws * speed_rpm / 60.0
        facts = {"segment_ms": plan.segment_ms, "speed_rpm": speed_rpm, "lobe_hz": lobe_hz}
        record = _number_near(5, "lathe.literal", f"{number}", roundness.ront_um, expected, WITHIN_UM, "um")
        records.append(replace(record, why="literal", facts=facts, basis=Basis.RIVAL))
    return tuple(records)


def literal_timing(paper: Experiments) -> tuple[Record, ...]:
    """Number 6: TA10 TS10 TM10 executed, experiment 1."""
    job, machine = paper.jobs[0], paper.machine
    plan, speed_rpm, _ = cut_and_measure(job, machine, Strategy.PAPER)
    moves = steady_moves(plan.program, plan.checked, machine)
    low, high = (each - plan.setup.surface for each in stroke(moves, plan.checked, machine))
    return (
        _number_near(6, "lathe.segment", "", plan.segment_ms, 20.0, 1e-6, "ms"),
        _number_near(6, "lathe.speed", "", speed_rpm, 500.0, 0.01, "rpm"),
        _number_near(6, "lathe.lobe_frequency", "", job.jaws * speed_rpm / 60.0, 25.0, 0.005, "Hz"),
        _number_near(6, "lathe.stroke", "", high - low, 183.3, 0.1, "cts"),
        _number_near(6, "lathe.mean", "", (high + low) / 2, 637.5, 0.1, "cts"),
    )


def inverse(paper: Experiments) -> tuple[Record, ...]:
    """Number 7: inverse feedforward, the plant as its profile says, quantisation on."""
    (cut,) = learned_passes(paper.jobs[0], paper.machine, ideal(paper.machine), [PART])
    parts = (cut_and_measure(job, paper.machine, Strategy.CAM)[2].ront_um for job in paper.jobs)
    return (
        _number_at_most(7, "lathe.lobe", "", cut.lobe_um_pp, 0.05),
        _number_at_most(7, "lathe.places", "", cut.places_um_pp, 0.3),
        *(Record(number=7, name="lathe.ours", at=f"{n}", ours=ront, unit="um") for n, ront in enumerate(parts, 1)),
    )


def wrong_plant(paper: Experiments) -> tuple[Record, ...]:
    """Number 8: a mass that is 10 % more and a gain that is 10 % less than the profile says."""
    as_said = ideal(paper.machine)
    true = replace(as_said, moving_mass_kg=1.1 * as_said.moving_mass_kg, force_n_per_v=0.9 * as_said.force_n_per_v)
    passes = learned_passes(paper.jobs[0], paper.machine, true, [AIR] * 4)
    limits_um = (10.0, 2.0, 0.5, 0.1)
    return tuple(
        _number_at_most(8, "lathe.pass", f"{number}", each.lobe_um_pp, limit)
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
        _number_at_most(9, "lathe.unlearned", "", unlearned.averaged_um_pp, 18.0),
        _number_at_most(9, "lathe.cut", "1", first.lobe_um_pp, 5.0),
        _number_at_most(9, "lathe.cut", "2", second.lobe_um_pp, 1.2),
        _number_at_most(9, "lathe.cut", "3", third.lobe_um_pp, 0.5),
        _number_at_most(9, "lathe.averaged", "", third.averaged_um_pp, 1.5),
    )


NUMBERS: Mapping[int, Callable[[Experiments], tuple[Record, ...]]] = {
    1: compare_uncompensated_parts,
    5: printed_program,
    6: literal_timing,
    7: inverse,
    8: wrong_plant,
    9: friction,
}
"""Function that computes each number."""


def _number_near(
    number: int, name: str, at: str, ours: float, expected: float, tolerance: float, unit: str
) -> Record:
    return Record(number=number, name=name, at=at, ours=ours, expected=expected, tolerance=tolerance, unit=unit)


def _number_at_most(number: int, name: str, at: str, ours: float, limit: float) -> Record:
    return Record(number=number, name=name, at=at, ours=ours, expected=limit, relation=Relation.AT_MOST, unit="um")
