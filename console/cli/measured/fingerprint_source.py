"""The fingerprint for a requested cut: from a file, or taken at the simulated lathe of this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from console.cli.arguments import INDICATOR
from console.cli.library import naming
from console.session.cut.in_process import simulated_context
from console.session.errors import SessionError
from console.session.learning.fingerprint import FingerprintedCut, fingerprint_cut, refuse_unusable
from console.session.stages import Stage
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.files import printable
from profiles.fingerprint.readings import ClampReadings, read_readings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem


def requested_fingerprint(
    source: str,
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    *,
    in_process: bool,
    simulated: bool,
    stage: Stage = Stage.FULL,
    true: TrueParameters | None = None,
    **cut: Any,
) -> FingerprintedCut:
    """Return the fingerprint in the file `source`, or of the indicator of the simulated lathe, for a cut.

    `true` is the simulated lathe, None one as its profile says; `cut` as for `fingerprint_cut`.
    Raises `ProblemError`: what speaks against the file, its readings or the cut.
    """
    refuse_unusable(strategy, stage, None, simulated=simulated)
    if source != INDICATOR:
        readings, where = read_readings(Path(source)), printable(source)
    elif in_process:
        readings, where = simulate_clamp_readings(job, machine, true), ""
    else:
        raise SessionError(Problem(code="clamping.no_indicator", key="--fingerprint", value=INDICATOR))
    refuse_unusable(strategy, stage, readings, simulated=simulated)
    with naming(where):
        return fingerprint_cut(readings, job, job, machine, strategy, **cut)


def simulate_clamp_readings(job: Job, machine: MachineProfile, true: TrueParameters | None) -> ClampReadings:
    """Return what an indicator shows on a simulated lathe of the clamping of its next part."""
    _, lathe = simulated_context(machine, true)
    lathe.mount(job)
    return lathe.indicate()
