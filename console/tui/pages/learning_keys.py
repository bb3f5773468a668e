"""Actions of the learning keys: keep a part's step, revert, choose the next compensation. Nothing moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.cut.compensated_cut import chosen_problems, inverting, using, with_accepted, without_learned
from console.session.data.identified_responses import ChosenResponse, kept_responses
from console.session.data.learned_store import NEWEST, asked_for, choose_version, date_problems, versions
from console.session.errors import SessionError, refuse
from console.session.guide.measured_part import edited_problems, why_not_accepted, why_not_reverted
from console.session.learning.calibrating import LOBE_TAKEN, PartLobe, accept_lobe, lobe_event
from console.session.learning.part_learning import accept, record_accepted, record_kept, revert
from console.session.stages import next_stage
from console.session.work import Work, open_work
from console.tui.ui_context import UiContext
from drivers.cutting.strategy import Strategy
from profiles.compensations.learned_compensation import LearnedCompensation
from profiles.problem import Problem, ProblemError


def accept_part(ui: UiContext, typed: float | None = None) -> None:
    """Keep the learning step of the measured part, or the lobe of a plain one; the next cut of its job uses it.

    `typed` is the value or the ratio of a lobe that is a large step.

    Raises:
        SessionError: `learned.no_part`, nothing was measured; `learned.other_job`, another job is open;
            `learned.edited_now`; those of `accept`; `lobe.taken`, and those of `accept_lobe`.
        ProfileError: as `accept` and `accept_lobe`. Nothing was changed.
    """
    part, work = ui.control.state.measured, ui.work
    if reasons := why_not_accepted(part, work):
        raise SessionError(*reasons)
    assert part is not None and work is not None
    if part.lobe is not None:
        _take_lobe(ui, part.lobe, work, part.run_id, typed)
        return
    assert part.learning is not None
    kept = accept(part.learning, ui.data)
    ui.work = using(work, kept)
    ui.key_answer = record_accepted(ui.data, part.run_id, kept)


def _take_lobe(ui: UiContext, lobe: PartLobe, work: Work, run_id: str | None, typed: float | None) -> None:
    """Keep the lobe of a plain part in its job, and open the job with it: the next cut is compensated."""
    written = accept_lobe(lobe, work.machine.machine, ui.data, typed)
    state, fresh = ui.control.state, open_work(written, work.machine)
    ui.work = with_accepted(fresh, ui.data, simulated=state.simulated, lathe=state.lathe)
    if run_id is not None:
        ui.key_answer = record_kept(ui.data, run_id, LOBE_TAKEN, lobe_event(written))


def revert_version(ui: UiContext) -> None:
    """Keep the version before the one in use again, and use it.

    Raises:
        SessionError: `learned.edited_now`; `screen.nothing_to_cut`, no job is open; those of `revert`.
        ProfileError: as `revert`. Nothing was changed.
    """
    work, simulated = ui.work, ui.control.state.simulated
    if reasons := why_not_reverted(work):
        raise SessionError(*reasons)
    assert work is not None
    older = revert(work.compensation, work.loaded, work.machine, ui.data, simulated=simulated)
    ui.work = using(work, older)


def step_compensation(ui: UiContext) -> None:
    """Toggle the open job between the newest version and the model; report anything unusual.

    Raises:
        SessionError: `learned.edited_now`, no version is for an edited job; `learned.none_yet`; those of
        `choose_version`. ProfileError: versions that cannot be read. The choice stays.
    """
    work = ui.work
    if work is None:
        return
    if work.compensation is not None and not work.set_aside:
        ui.work = without_learned(work)
        return
    state = ui.control.state
    newest = _newest(work, ui.data, simulated=state.simulated, lathe=state.lathe)
    ui.work = using(work, newest)
    ui.key_answer = date_problems(newest)


def step_response(ui: UiContext) -> None:
    """Select the next identified response of this machine and strategy, newest first; after the oldest the model.

    Raises:
        SessionError: as `kept_responses`, none is kept or applies. The choice stays.
        ProfileError: those kept cannot be read.
    """
    work = ui.work
    if work is None:
        return
    kept = _offered_responses(work, ui.data, simulated=ui.control.state.simulated)
    names = [chosen.name for chosen in kept]
    following = 0
    if work.inverts is not None:
        following = names.index(work.inverts.name) + 1 if work.inverts.name in names else len(kept)
    ui.work = inverting(work, kept[following] if following < len(kept) else None)
    say_what_does_not_hold(ui)


def why_no_response(work: Work, data: Path, *, simulated: bool) -> tuple[Problem, ...]:
    """Return why `step_response` would raise for this work; reads the responses of its machine."""
    try:
        _offered_responses(work, data, simulated=simulated)
    except ProblemError as error:
        return tuple(error.problems)
    return ()


def _offered_responses(work: Work, data: Path, *, simulated: bool) -> tuple[ChosenResponse, ...]:
    """Return the responses that may be chosen; none, once one is chosen, where no other applies."""
    try:
        return kept_responses(data, work.machine.machine, Strategy(work.strategy), simulated=simulated)
    except ProblemError:
        if work.inverts is None:
            raise
        return ()  # the model can always be chosen again


def why_no_compensation(work: Work, data: Path, *, simulated: bool, lathe: str = "") -> tuple[Problem, ...]:
    """Return why `step_compensation` would raise for this work; reads the versions of its job."""
    try:
        if work.compensation is None or work.set_aside:
            _newest(work, data, simulated=simulated, lathe=lathe)
    except ProblemError as error:
        return tuple(error.problems)
    return ()


def _newest(work: Work, data: Path, *, simulated: bool, lathe: str) -> LearnedCompensation:
    refuse(edited_problems(work))
    asked = asked_for(work.loaded, work.machine, work.strategy, simulated=simulated, lathe=lathe)
    known = versions(data, asked)
    if not known:
        raise SessionError(Problem(code="learned.none_yet", key=work.loaded.job.name))
    newest = choose_version(NEWEST, known, asked)
    assert newest is not None
    return newest


def step_stage(ui: UiContext) -> None:
    """Select the next stage: whole, air, and half where there is one; report a conflict with the other choices."""
    work = ui.work
    if work is None:
        return
    ui.work = replace(work, stage=next_stage(work.stage, Strategy(work.strategy)))
    say_what_does_not_hold(ui)


def say_what_does_not_hold(ui: UiContext) -> None:
    """Report why the open job may not be cut with the present choices, if so."""
    if ui.work is not None:
        state = ui.control.state
        ui.key_answer = chosen_problems(ui.work, simulated=state.simulated, lathe=state.lathe)
