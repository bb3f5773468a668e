"""Passes of one cut that learn by the tool scale alone, in air and in the part, and the error of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from console.session.reproduction.bench import Bench, shortened
from drivers.cutting.planning import CutPlan, nominal_command
from drivers.cutting.sampling import Batch
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.compensations.learning import fit_harmonics, learned_command
from profiles.compensations.path import CutPath, LobedPath, target_path
from profiles.job import Job
from profiles.least_squares import fit, harmonic_columns
from profiles.machine import MachineProfile

BATCH_S = 1.0
CLEAR_MM = 1.0
"""Distance of the tool from the part in air."""

WAVES = tuple(range(1, 16))
"""Harmonics per revolution from which an average turn is built."""

OVERTONES = 3
DRIFT_POWERS = 3
"""A compliant axis drifts back to its depth while it cuts; that is size and taper, no roundness: removed first."""

_AROUND_DEG = np.arange(0.0, 360.0, 0.5)

Floats = NDArray[np.float64]


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
    bench, short = Bench(machine, true), shortened(job)
    path = CutPath(target=target_path(job), command=nominal_command(job, machine, Strategy.CAM))

    def response(waves: int) -> complex:
        return nominal_response(Strategy.CAM, machine, waves * job.spindle_speed_rpm / 60.0)

    passes = []
    for air in in_air:
        out_mm = CLEAR_MM + job.depth_of_cut_mm if air else 0.0
        plan = bench.plan(short, Strategy.CAM, path=path, air_mm=out_mm)
        watch = _Watch(bench, path.target, job.jaws)
        bench.cut(short, plan, watch, air=air)
        angle_deg, off_um = watch.off()
        found = fit_harmonics(angle_deg, off_um, WAVES).coefficients_um
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
    waves = [np.real(c * np.exp(1j * n * np.radians(_AROUND_DEG))) for n, c in found.items() if n > 1]
    return float(np.ptp(np.sum(waves, axis=0)))


def _steady(angle_deg: Floats, off_um: Floats) -> Floats:
    """Return the error without its drift."""
    fed = (angle_deg - angle_deg[0]) / np.ptp(angle_deg)
    drift = (fed**power for power in range(1, DRIFT_POWERS + 1))
    return fit(harmonic_columns(fed, (), *drift), off_um).residuals


class _Watch:
    """Gather one batch of a pass, and sample the true position while the tool is on its path."""

    def __init__(self, bench: Bench, target: LobedPath, lobes: int) -> None:
        self._bench, self._target, self._lobes = bench, target, lobes
        self._gather = bench.lathe.program.batches()
        self._batches: list[Batch] = []
        self._true_position: list[tuple[float, float]] = []
        self._plan: CutPlan | None = None

    def begin(self, plan: CutPlan) -> None:
        """Set up gathering on the controller."""
        self._plan = plan
        self._gather.prepare(plan, self._lobes, BATCH_S, self._batches.append)

    def see(self, snapshot: Snapshot) -> None:
        """Continue gathering, and sample."""
        assert self._plan is not None  # a cut begins before it is seen
        setup = self._plan.setup
        fed = snapshot.carriage.position - self._plan.carriage_start
        # Two turns at each end are left out: the tool may still be moving in or out.
        clear = 2.0 * setup.carriage_per_turn
        steady = clear < fed < setup.carriage_counts - clear and snapshot.tool.position > setup.surface
        if snapshot.program_running and steady:
            self._true_position.append(self._bench.true_position())
        self._gather.see(snapshot)

    def off(self) -> tuple[Floats, Floats]:
        """Return spindle angles (deg) and how much too far out the tool was there, by its scale; (M,) each."""
        batch = self._batches[-1]
        off_um = self._target.at_um(batch.angle_deg, batch.past_middle_mm) - batch.infeed_um
        return batch.angle_deg, _steady(batch.angle_deg, off_um)

    def places_um_pp(self) -> float:
        """Return the same of the true positions, over all samples: peak to peak."""
        assert self._plan is not None
        machine, (tool, spindle) = self._bench.machine, np.array(self._true_position).T
        angle_deg = spindle / machine.spindle.counts_per_rev * 360.0
        infeed_um = (tool - self._plan.setup.surface) * machine.tool.count_um
        return float(np.ptp(_steady(angle_deg, self._target.at_um(angle_deg) - infeed_um)))
