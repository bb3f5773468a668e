"""The fingerprint that a cut is asked with: from a file, or taken at the simulated lathe of this process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.cli.arguments import INDICATOR
from console.cli.library import naming
from console.session.cut.in_process import simulated_context
from console.session.errors import SessionError
from console.session.learning.fingerprint import Fingerprint, fingerprinted, refuse_unusable
from console.session.stages import Stage
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.axis.response import ServoResponse
from profiles.compensations.learned import LearnedCompensation
from profiles.compensations.path import CutPath
from profiles.files import printable
from profiles.fingerprint.readings import ClampReadings, read_readings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedCut:
    """The cut that a fingerprint is for; `true` is the simulated lathe, None one as its profile says."""

    job: Job
    machine: MachineProfile
    strategy: Strategy
    stage: Stage = Stage.FULL
    path: CutPath | None = None
    inverted: ServoResponse | None = None
    history: tuple[LearnedCompensation, ...] = ()
    true: TrueParameters | None = None


def asked_fingerprint(asked: str, cut: AskedCut, *, in_process: bool, simulated: bool) -> Fingerprint:
    """Return the fingerprint of the file that was `asked` for, or of the indicator of the simulated lathe.

    Raises `ProblemError`: what speaks against the file, its readings or the cut.
    """
    refuse_unusable(cut.strategy, cut.stage, None, simulated=simulated)
    if asked != INDICATOR:
        readings, where = read_readings(Path(asked)), printable(asked)
    elif in_process:
        readings, where = indicated(cut.job, cut.machine, cut.true), ""
    else:
        raise SessionError(Problem(code="clamping.no_indicator", key="--fingerprint", value=INDICATOR))
    refuse_unusable(cut.strategy, cut.stage, readings, simulated=simulated)
    with naming(where):
        return fingerprinted(
            readings,
            cut.job,
            cut.job,
            cut.machine,
            cut.strategy,
            path=cut.path,
            history=cut.history,
            inverted=cut.inverted,
        )


def indicated(job: Job, machine: MachineProfile, true: TrueParameters | None) -> ClampReadings:
    """Return what an indicator shows on a simulated lathe of the clamping of its next part."""
    _, lathe = simulated_context(machine, true)
    lathe.mount(job)
    return lathe.indicate()
