"""Why a key of the page Align cannot do its step now, once the machine itself is ready."""

from __future__ import annotations

from console.session.cut.alignment import AlignStep, force_problems, step_problems, table_problems
from console.session.cut.jaw_by_indicator import READINGS, allowed_spread_deg, spread_problem
from console.session.station.state import StationState
from console.tui.align.left_part import drives_are_on, may_be_in_part
from console.tui.pages import align_lines
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

_BY_HAND = {AlignStep.CLAMP: "screen.enter_does_it", AlignStep.JAW: "screen.jog_does_it"}


def align_reasons(
    action: str, state: StationState, job: Job | None, machine: MachineProfile
) -> tuple[Problem, ...]:
    """Return why the step of a key cannot be done, empty where it can, or where the key has no step."""
    match action:
        case "align.step":
            return _against_step(state, job, machine)
        case "align.take":
            return _against_take(state, job, machine)
        case "align.back":
            return _against_back(state, job)
        case "align.goto":
            return _against_target(state)
        case "align.flank":
            return _against_flank(state, job)
        case "align.clamping":
            return _against_readings(state, job)
        case "align.skim":
            return _against_skim(state, job, machine)
        case "align.force" if job is None:
            return _because("screen.nothing_to_align")
        case "align.off" if not drives_are_on(state):
            return _because("screen.drives_are_off")
    return ()


def _against_step(state: StationState, job: Job | None, machine: MachineProfile) -> tuple[Problem, ...]:
    match align_lines.step_now(state.alignment, job):
        case AlignStep.CLAMP if align_lines.must_come_out(state, machine):
            closed = state.snapshot is not None and state.snapshot.loops_closed
            return (table_problems(state.alignment) or _because("machine.tool_in_part")) if closed else ()
        case AlignStep.CLAMP if drives_are_on(state) or may_be_in_part(state):
            return ()
        case AlignStep.TOUCH_OFF if job is None:
            return _because("screen.nothing_to_align")
        case None:
            return _because("screen.nothing_to_align" if job is None else "screen.aligned")
        case step if step in _BY_HAND:
            return _because(_BY_HAND[step])
    return ()


def _against_take(state: StationState, job: Job | None, machine: MachineProfile) -> tuple[Problem, ...]:
    if job is None:
        return _because("screen.nothing_to_align")
    match align_lines.step_now(state.alignment, job):
        case AlignStep.CLAMP:
            return _against_clamping(state, job, machine)
        case AlignStep.DRIVES if not drives_are_on(state):
            # Another blank: the chuck may have been opened since the drives were disabled after a cut.
            return _against_clamping(state, job, machine)
        case AlignStep.JAW if state.alignment.flanks:
            problem = spread_problem(state.alignment.flanks, allowed_spread_deg(job))
            return () if problem is None else (problem,)
        case AlignStep.TOUCH_OFF if not align_lines.is_over_part(state, machine):
            return (Problem(code="alignment.beside_part", key="tool"),)
        case AlignStep.JAW | AlignStep.TOUCH_OFF:
            return ()
        case None:
            return _because("screen.aligned")
    return _because("screen.f4_does_it")


def _against_clamping(state: StationState, job: Job, machine: MachineProfile) -> tuple[Problem, ...]:
    if drives_are_on(state):
        return table_problems(state.alignment) or _because("screen.drives_not_off")
    if state.alignment.tables:
        return table_problems(state.alignment)
    return _because("machine.tool_in_part") if align_lines.is_in_part(state, machine) else force_problems(job)


def _against_back(state: StationState, job: Job | None) -> tuple[Problem, ...]:
    alignment = state.alignment
    if alignment.flanks or alignment.skim_counts is not None:
        return ()
    later = align_lines.step_now(alignment, job) in (AlignStep.TOUCH_OFF, None)
    taken = alignment.jaw is not None or alignment.touch_off is not None
    return () if later and taken else _because("screen.nothing_to_take_back")


def _against_flank(state: StationState, job: Job | None) -> tuple[Problem, ...]:
    if job is None:
        return _because("screen.nothing_to_align")
    if align_lines.step_now(state.alignment, job) is not AlignStep.JAW:
        return _because("screen.no_flank_now")
    if len(state.alignment.flanks) >= READINGS:
        return (Problem(code="alignment.flanks_complete", limit=str(READINGS)),)
    return ()


def _against_readings(state: StationState, job: Job | None) -> tuple[Problem, ...]:
    if job is None:
        return _because("screen.nothing_to_align")
    clamped = not step_problems(state.alignment, AlignStep.CLAMP, job)
    return () if clamped else _because("screen.no_readings_now")


def _against_skim(state: StationState, job: Job | None, machine: MachineProfile) -> tuple[Problem, ...]:
    if job is None:
        return _because("screen.nothing_to_align")
    if align_lines.step_now(state.alignment, job) not in (AlignStep.TOUCH_OFF, None):
        return _because("screen.no_skim_now")
    if state.alignment.skim_counts is None and not align_lines.is_over_part(state, machine):
        return (Problem(code="alignment.beside_part", key="tool"),)
    return ()


def _against_target(state: StationState) -> tuple[Problem, ...]:
    """Return why no target can be typed: without drives or zeros it would mean nothing."""
    alignment = state.alignment
    if drives_are_on(state) and alignment.drives_on and alignment.homed:
        return ()
    return _because("alignment.drives_off" if not alignment.drives_on else "alignment.not_homed")


def _because(code: str) -> tuple[Problem, ...]:
    return (Problem(code=code),)
