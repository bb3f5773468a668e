"""Test rig: a simulated lathe in this process, the parts cut on it, and passes that learn by the tool scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from console.session.cut.in_process import simulated_context
from console.session.cut.run import Beside, CutOutcome, cut_part
from console.session.learning.learning_beside import AirWatch
from console.session.stages import AIR_MM, nominal_path
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response
from drivers.lathe.heartbeat import cut_condition
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.compensations.learning import fit_harmonics, learned_command
from profiles.compensations.path import CutPath, LobedPath
from profiles.job import Job
from profiles.least_squares import fit, harmonic_columns
from profiles.machine import MachineProfile
from profiles.roundness import RoundnessResult, evaluate

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
        self.machine = machine
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

    def cut(self, job: Job, plan: CutPlan, beside: Beside | None = None, *, air: bool = False) -> CutOutcome:
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


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part with the plan of its cut; its roundness is that of the free state, unfiltered."""

    plan: CutPlan
    spindle_speed_rpm: float
    roundness: RoundnessResult


def part_of(job: Job, machine: MachineProfile, strategy: Strategy, ts_ms: int | None = None) -> Part:
    """Cut a part on a new lathe that is as its profile says, and measure it without a filter."""
    bench, short = Bench(machine), replace(job, cut_length_mm=CUT_MM)
    plan = bench.plan(short, strategy, ts_ms)
    outcome = bench.cut(short, plan)
    assert outcome.trace is not None  # the rig measures
    roundness = evaluate(outcome.trace.angle_deg, outcome.trace.deviation_um, None)
    return Part(plan=plan, spindle_speed_rpm=outcome.figures.spindle_speed_rpm, roundness=roundness)


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
