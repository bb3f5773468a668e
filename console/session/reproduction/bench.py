"""Test rig: a simulated lathe in this process, as in `console run --sim`, and one short part cut on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from console.session.cut.headless import Beside, CutOutcome, cut_part
from console.session.cut.in_process import simulated_context
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import cut_condition
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.compensations.path import CutPath
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import RoundnessResult, evaluate

CUT_MM = 1.5
"""Thirty turns of the paper's jobs: the part is measured in the middle, and is the same in a longer cut."""


class Bench:
    """One lathe. Parts are cut on it one after another; it is homed for the first."""

    def __init__(self, machine: MachineProfile, true: TrueParameters | None = None) -> None:
        """Take `true`, the actual hardware; None for one as its profile says."""
        self.machine = machine
        self._context, self._lathe = simulated_context(machine, true)
        self.lathe = self._context.lathe
        self._homed = False

    def plan(
        self,
        job: Job,
        strategy: Strategy,
        ts_ms: int | None = None,
        *,
        path: CutPath | None = None,
        air_mm: float = 0,
    ) -> CutPlan:
        """Plan a cut from the whole turn nearest to the spindle position."""
        return plan_cut(
            job,
            self.machine,
            strategy,
            ts_ms,
            from_turn=self._turn(),
            watchdog=cut_condition(self.machine),
            path=path,
            air_mm=air_mm,
        )

    def cut(self, job: Job, plan: CutPlan, beside: Beside | None = None, *, air: bool = False) -> CutOutcome:
        """Cut a part; without one, cut in air.

        Raises:
            ProblemError: what went wrong.
        """
        outcome = cut_part(self._context, job, plan, lambda *_: None, beside, homed=self._homed, blank=not air)
        self._homed = True
        return outcome

    def true_position(self) -> tuple[float, float]:
        """Return the true positions of tool and spindle, counts, finer than the encoders resolve."""
        motors = self._lathe.controller.motors
        return motors[self.machine.tool.motor].true_position, motors[self.machine.spindle.motor].true_position

    def _turn(self) -> int:
        if not self._homed:
            return 0
        return round(self.lathe.snapshot().spindle.position / self.machine.spindle.counts_per_rev)


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part with the plan of its cut. The angle and deviation have shape (M,), free state, unfiltered."""

    plan: CutPlan
    spindle_speed_rpm: float
    roundness: RoundnessResult
    angle_deg: NDArray[np.float64]
    deviation_um: NDArray[np.float64]


def shortened(job: Job) -> Job:
    """Return the job with a short cut."""
    return replace(job, cut_length_mm=CUT_MM)


def part_of(job: Job, machine: MachineProfile, strategy: Strategy, ts_ms: int | None = None) -> Part:
    """Cut a part on a new lathe that is as its profile says, and measure it without a filter."""
    bench, short = Bench(machine), shortened(job)
    plan = bench.plan(short, strategy, ts_ms)
    outcome = bench.cut(short, plan)
    assert outcome.trace is not None  # the rig measures
    angle, deviation = outcome.trace.angle_deg, outcome.trace.deviation_um
    return Part(
        plan=plan,
        spindle_speed_rpm=outcome.figures.spindle_speed_rpm,
        roundness=evaluate(angle, deviation, None),
        angle_deg=angle,
        deviation_um=deviation,
    )
