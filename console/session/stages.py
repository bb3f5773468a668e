"""How much of a compensation a part is cut with: in air, a share of it, or all of it."""

from __future__ import annotations

from enum import StrEnum

from console.session.errors import SessionError
from drivers.cutting.planning import nominal_command
from drivers.cutting.strategy import INVERTING, Strategy
from profiles.axis.response import ServoResponse
from profiles.compensations.path import PARTIAL_SHARE, CutPath, share_of, target_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

AIR_MM = 1.0
"""How far out of the part the tool stays in air, more than any depth of cut and lobe."""


class Stage(StrEnum):
    """The steps of a first part.

    `air` is the whole program out of the part, `partial` half of the compensation at the full depth, `full` the
    part as it is meant.
    """

    AIR = "air"
    PARTIAL = "partial"
    FULL = "full"

    @property
    def share(self) -> float:
        """Which share of the compensation the tool does."""
        return PARTIAL_SHARE if self is Stage.PARTIAL else 1.0


def nominal_path(
    job: Job, machine: MachineProfile, strategy: Strategy, response: ServoResponse | None = None
) -> CutPath:
    """Return what a cut does of which nothing was learned; `response` is what it inverts, None the model's.

    Raises:
        ProfileError: those of `nominal_command`.
    """
    command = nominal_command(job, machine, strategy, response)
    return CutPath(target=target_path(job), command=command)


def staged(
    job: Job, machine: MachineProfile, strategy: Strategy, stage: Stage, path: CutPath | None
) -> CutPath | None:
    """Return the path of a stage; `path` is what was learned, None as for `plan_cut`.

    Raises:
        ProblemError: `stage.strategy`, there is no share of a strategy that follows no path; those of
            `nominal_path`.
    """
    if stage is not Stage.PARTIAL:
        return path
    if not strategy.traits.inverts:
        limit = " | ".join(INVERTING)
        raise SessionError(Problem(code="stage.strategy", key=stage, value=strategy, limit=limit))
    return share_of(path or nominal_path(job, machine, strategy), stage.share)


def air_mm(job: Job, stage: Stage) -> float:
    """Return how far further out a stage is cut."""
    return AIR_MM + job.depth_of_cut_mm if stage is Stage.AIR else 0.0
