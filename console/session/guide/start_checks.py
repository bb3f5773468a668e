"""The interlocks of the start of a cut: the answer to "why can I not start"."""

from __future__ import annotations

from collections.abc import Iterator

from console.session.cut.alignment import aligned_job, aligned_machine, problems
from console.session.cut.compensated_cut import chosen_problems
from console.session.cut.interlocks import Interlock, of_drives, of_home, of_job, of_lobe
from console.session.learning.fingerprint import expected_of
from console.session.stages import Stage
from console.session.station.progress import CutStage
from console.session.station.state import StationState
from console.session.work import Work
from drivers.cutting.strategy import Strategy
from drivers.lathe.snapshot import Snapshot
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError


def checks(state: StationState, work: Work | None, machine: MachineProfile) -> tuple[Interlock, ...]:
    """Return every interlock of the start, in the order in which to fix them."""
    snapshot = state.snapshot
    if snapshot is None:
        return (Interlock(name="link", problems=(Problem(code="screen.nothing_known"),)),)
    stopped = () if state.stop is None else (Problem(code="screen.stopped_first", key="F5"),)
    faults = tuple(_fault(fault, snapshot) for fault in snapshot.axis_faults)
    rest = (Problem(code="screen.in_motion"),) if state.seen_moving else ()
    return (
        *([Interlock(name="commissioned", problems=state.uncommissioned)] if state.uncommissioned else []),
        Interlock(name="no_stop", problems=stopped),
        # Disabled drives report none, whatever is wrong.
        Interlock(name="no_fault", problems=faults, waits=not faults and not snapshot.loops_closed),
        *_of_work(state, work, machine),
        of_drives(snapshot),
        of_home(snapshot),
        Interlock(name="at_rest", problems=rest),
        *_blank_check(state),
        Interlock(name="program", waits=state.armed is None),
    )


def _fault(fault: str, snapshot: Snapshot) -> Problem:
    """Return what is wrong with an axis; off a travel limit it is jogged with its drive on."""
    jogs = fault in snapshot.limits and snapshot.loops_closed
    return Problem(code="screen.axis_on_limit" if jogs else "screen.axis_fault", value=fault)


def _blank_check(state: StationState) -> Iterator[Interlock]:
    """Check that the blank is uncut. A partly cut one may be cut again, by somebody who knows of it.

    Nothing is said of a blank while none is clamped, which the alignment says.
    """
    marks = ", ".join(f"{mark_mm:.1f}" for mark_mm in state.marks_mm)
    marked = (Problem(code="screen.part_is_marked", value=marks),) if marks else ()
    touched = state.cut_to
    if state.cut_done:
        yield Interlock(name="fresh_blank", problems=(Problem(code="screen.part_is_cut"),), warnings=marked)
    elif touched is not None:
        value, limit = f"{touched.to_mm:.1f}", f"{touched.of_mm:.1f}"
        again = Problem(code="screen.part_is_touched", value=value, limit=limit)
        yield Interlock(name="touched_blank", warnings=(again, *marked))
    elif marked:
        yield Interlock(name="touched_blank", warnings=marked)
    elif state.alignment.clamping is not None:
        yield Interlock(name="fresh_blank")


def _of_work(state: StationState, work: Work | None, machine: MachineProfile) -> Iterator[Interlock]:
    chosen: tuple[Problem, ...] | None = None
    if state.armed is not None:
        job, strategy, stage = state.armed.job, state.armed.strategy, state.armed.made.stage
    elif work is not None:
        job, strategy, stage = work.job, Strategy(work.strategy), work.stage
        if work.compensation is not None or work.inverts is not None or stage != Stage.FULL:
            chosen = chosen_problems(work, simulated=state.simulated, lathe=state.lathe)
    else:
        yield Interlock(name="job", problems=(Problem(code="screen.nothing_to_cut"),))
        return
    fits = of_job(job, aligned_machine(machine, state.alignment))
    as_found = of_lobe(job, machine, strategy, simulated=state.simulated)
    yield Interlock(name="job", problems=(*fits.problems, *as_found.problems))
    aside = () if work is None or state.armed is not None else work.set_aside
    if chosen is not None or aside:
        yield Interlock(name="learned", problems=chosen or (), warnings=aside)
    placed = job if state.armed is not None else aligned_job(job, state.alignment)
    # The cutting force of the half stage may have contradicted a full one.
    against = None if state.force is None else state.force.contradicts(placed)
    if against is not None and stage == Stage.FULL and strategy.traits.inverts:
        yield Interlock(name="force", warnings=(against,))
    if strategy.traits.inverts and (unlikely := _unlikely_readings(state, stage, placed, machine)):
        yield Interlock(name="fingerprint", warnings=unlikely)
    yield Interlock(name="aligned", problems=problems(state.alignment, job))


def _unlikely_readings(state: StationState, stage: str, job: Job, machine: MachineProfile) -> tuple[Problem, ...]:
    """Return what is unlikely of the indicator readings: by job and chuck, once armed by all parts so far."""
    readings = state.alignment.readings
    if readings is None or state.armed is not None:
        return () if readings is None or state.armed is None else state.armed.warnings
    try:
        return () if stage == Stage.AIR else expected_of(readings, job, machine)
    except ProfileError:  # arming refuses them with the reason
        return ()


def failing(found: tuple[Interlock, ...]) -> tuple[Problem, ...]:
    """Return every reason why a cut may not be armed, each once; the drives are part of the alignment, too."""
    return tuple(dict.fromkeys(problem for check in found for problem in check.problems))


def is_over(state: StationState) -> bool:
    """Whether the clamped blank is cut to its end, measured or not: the next cut needs another one."""
    cut = state.cut
    return state.cut_done or (cut is not None and cut.stage is CutStage.DONE and not cut.in_air)
