"""What the keys of the page Preview choose beside the strategy: compensation, and stage of a first part."""

from __future__ import annotations

from dataclasses import replace

from console.session.compensated import chosen_problems, using, without_learned
from console.session.errors import SessionError
from console.session.learned_store import NEWEST, asked_for, chosen, date_problems, versions
from console.session.work import STAGES
from console.tui.desk import Desk
from profiles.problem import Problem


def step_compensation(desk: Desk) -> None:
    """Take the newest version for the job in hand, or the model again where that one is in use; say what is odd.

    Raises:
        SessionError: `learned.edited_now`, no version is for an edited job; `learned.none_yet`; those of `chosen`.
        ProfileError: versions that cannot be read. What was chosen stays.
    """
    work = desk.work
    if work is None:
        return
    if work.compensation is not None and not work.set_aside:
        desk.work = without_learned(work)
        return
    if work.edited:
        raise SessionError(Problem(code="learned.edited_now", key=work.loaded.job.name))
    simulated = desk.control.state.simulated
    asked = asked_for(work.loaded, work.machine, work.strategy, simulated=simulated)
    known = versions(desk.data, asked)
    if not known:
        raise SessionError(Problem(code="learned.none_yet", key=work.loaded.job.name))
    newest = chosen(NEWEST, known, asked)
    assert newest is not None
    desk.work = using(work, newest)
    desk.said = date_problems(newest)


def step_stage(desk: Desk) -> None:
    """Take the next stage: whole, air, half; what it cannot be cut with is said."""
    work = desk.work
    if work is None:
        return
    desk.work = replace(work, stage=STAGES[(STAGES.index(work.stage) + 1) % len(STAGES)])
    say_what_does_not_hold(desk)


def say_what_does_not_hold(desk: Desk) -> None:
    """Say why the job in hand may not be cut with what is chosen, if so."""
    if desk.work is not None:
        desk.said = chosen_problems(desk.work, simulated=desk.control.state.simulated)
