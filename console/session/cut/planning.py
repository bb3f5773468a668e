"""Planning of a cut: checks of job, machine and strategy before it, and of the resulting program."""

from __future__ import annotations

from console.session.cut.interlocks import Interlock, of_job, of_lobe, of_program, of_zero, refuse_unless
from console.session.stages import Stage, air_mm, staged
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from profiles.compensations.path import CutPath
from profiles.job import Job
from profiles.machine import MachineProfile


def refuse_unplannable(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    *also: Interlock,
    jaw_found: bool,
    simulated: bool,
    where: str = "",
) -> None:
    """Refuse a job that does not fit the machine, with all other objections at once.

    `where` is the file that a refusal of the job names. `jaw_found`: jaw 1 was found at the machine, see
    `of_zero`. `simulated`: nothing real is cut, see `of_lobe`.

    Raises:
        SessionError: every reason.
    """
    lobe = of_lobe(job, machine, strategy, simulated=simulated)
    refuse_unless(of_job(job, machine, where), lobe, of_zero(machine, strategy, jaw_found=jaw_found), *also)


def planned(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    stage: Stage,
    path: CutPath | None,
    *,
    watchdog: str,
    ts_ms: int | None = None,
    from_turn: int = 0,
    trimmed: bool = False,
) -> CutPlan:
    """Plan a cut in a stage, see `plan_cut`; `path` is what was learned or identified, None the model's.

    Raises:
        ProblemError: those of `staged` and `plan_cut`, and what forbids the program.
    """
    plan = plan_cut(
        job,
        machine,
        strategy,
        ts_ms=ts_ms,
        from_turn=from_turn,
        watchdog=watchdog,
        path=staged(job, machine, strategy, stage, path),
        air_mm=air_mm(job, stage),
        trimmed=trimmed,
    )
    refuse_unless(of_program(plan))
    return plan
