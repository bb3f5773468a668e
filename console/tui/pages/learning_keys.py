"""What the keys of the panel Learn do: keep what a part teaches, or go back. Files alone; nothing moves."""

from __future__ import annotations

from console.session.compensated import using
from console.session.errors import SessionError
from console.session.part_lesson import PartLesson, accept, revert
from console.session.work import Work
from console.tui.desk import Desk
from profiles.learned import HoldsFor
from profiles.problem import Problem


def accept_lesson(desk: Desk) -> None:
    """Keep what the measured part teaches; the next cut of its job uses it.

    Raises:
        SessionError: `learned.no_part`, nothing was measured; `learned.other_job`, another job is in hand;
            `learned.edited_now`; those of `accept`.
        ProfileError: as `accept`. Nothing was changed.
    """
    part = desk.control.state.measured
    lesson: PartLesson | None = None if part is None else part.lesson
    if part is None or lesson is None:
        raise SessionError(Problem(code="learned.no_part"))
    if lesson.taught is None:
        raise SessionError(*lesson.problems)
    work = _work_on(desk, part.job.name, lesson.taught.lesson.next.holds_for)
    desk.work = using(work, accept(lesson, desk.data))


def revert_version(desk: Desk) -> None:
    """Keep the version before the one in use once more, and use it.

    Raises:
        SessionError: `learned.edited_now`; `screen.nothing_to_cut`, no job is in hand; those of `revert`.
        ProfileError: as `revert`. Nothing was changed.
    """
    work, simulated = desk.work, desk.control.state.simulated
    if work is None:
        raise SessionError(Problem(code="screen.nothing_to_cut"))
    _refuse_edited(work)
    older = revert(work.compensation, work.loaded, work.machine, desk.data, simulated=simulated)
    desk.work = using(work, older)


def _work_on(desk: Desk, job: str, holds_for: HoldsFor) -> Work:
    """Return the work in hand, if it is that of the part, as it is filed."""
    work = desk.work
    if work is None or (work.loaded.job.name, work.loaded.sha256) != (holds_for.job, holds_for.job_sha256):
        raise SessionError(Problem(code="learned.other_job", key=job))
    _refuse_edited(work)
    return work


def _refuse_edited(work: Work) -> None:
    if work.edited:
        raise SessionError(Problem(code="learned.edited_now", key=work.loaded.job.name))
