"""Stages of a first part: how much of its compensation is cut, in air, a fraction, or all."""

from __future__ import annotations

from enum import StrEnum

from console.session.errors import SessionError
from console.session.work import STAGES
from drivers.cutting.planning import nominal_command
from drivers.cutting.strategy import INVERTING, Strategy
from profiles.axis.response import ServoResponse
from profiles.compensations.path import PARTIAL_FRACTION, CutPath, fraction_of, target_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

AIR_MM = 1.0  # clearance of the tool in an air cut, more than any depth of cut and lobe


class Stage(StrEnum):
    """Stages of a first part: the program clear of it, half of the compensation at full depth, and all of it."""

    AIR = "air"
    PARTIAL = "partial"
    FULL = "full"

    @property
    def fraction(self) -> float:
        """Fraction of the compensation that the tool follows."""
        return PARTIAL_FRACTION if self is Stage.PARTIAL else 1.0


def next_stage(stage: str, strategy: Strategy) -> str:
    """Return the stage behind this one: whole, air, half; a strategy that follows no path has no half of it."""
    following = STAGES[(STAGES.index(stage) + 1) % len(STAGES)]
    return STAGES[0] if following == Stage.PARTIAL and not strategy.traits.inverts else following


def without_half(strategy: Strategy) -> str:
    """Return the suffix of the sentences on the stages to come: those of a strategy that has no half, or none."""
    return "" if strategy.traits.inverts else "_no_half"


def nominal_path(
    job: Job, machine: MachineProfile, strategy: Strategy, response: ServoResponse | None = None
) -> CutPath:
    """Return the path of a cut with nothing learned; `response` is what it inverts, None the model's."""
    return CutPath(target=target_path(job), command=nominal_command(job, machine, strategy, response))


def scale_path_to_stage(
    job: Job, machine: MachineProfile, strategy: Strategy, stage: Stage, path: CutPath | None
) -> CutPath | None:
    """Return the path of a stage; `path` is what was learned, None as for `plan_cut`. Refused: `not_staged`."""
    if stage is not Stage.PARTIAL:
        return path
    if not strategy.traits.inverts:
        raise SessionError(not_staged(stage, strategy))
    return fraction_of(path or nominal_path(job, machine, strategy), stage.fraction)


def not_staged(stage: Stage, strategy: Strategy) -> Problem:
    """Return the problem that this strategy follows no path, and has no fraction of it."""
    return Problem(code="stage.strategy", key=stage, value=strategy, limit=" | ".join(INVERTING))


def air_mm(job: Job, stage: Stage) -> float:
    """Return the extra clearance of a stage."""
    return AIR_MM + job.depth_of_cut_mm if stage is Stage.AIR else 0.0
