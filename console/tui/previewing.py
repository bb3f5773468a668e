"""Computing the preview of the job in hand beside the screen, always of its newest version."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import TYPE_CHECKING

from console.session.alignment import Alignment, aligned_job, aligned_machine
from console.session.work import Work
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    from console.session.preview import Preview

Question = tuple[Job, MachineProfile]


class Previewer:
    """Answers one question at a time in a thread of its own; `refreshed` is asked at every tick."""

    def __init__(self) -> None:
        self._answer: tuple[Question, Preview | None, tuple[Problem, ...]] | None = None
        self._thread: threading.Thread | None = None
        self._settled: tuple[Work, Alignment] | None = None

    def refreshed(self, work: Work, alignment: Alignment) -> Work:
        """Return the work with the preview of exactly this job, where it is there; begin to compute it else.

        Jaw 1 is where the alignment found it, the tool tip where the touch-off did.
        """
        if self._settled is not None and self._settled[0] is work and self._settled[1] is alignment:
            return work
        answered = self._answered(work, alignment)
        self._settled = (answered, alignment) if answered.preview or answered.preview_problems else None
        return answered

    def _answered(self, work: Work, alignment: Alignment) -> Work:
        question = (aligned_job(work.job, alignment), aligned_machine(work.machine.machine, alignment))
        if self._answer is not None and self._answer[0] == question:
            _, preview, problems = self._answer
            if work.preview is preview and work.preview_problems == problems:
                return work
            return replace(work, preview=preview, preview_problems=problems)
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._compute, args=(question,), name="preview", daemon=True)
            self._thread.start()
        return work if work.preview is None else replace(work, preview=None, preview_problems=())

    def _compute(self, question: Question) -> None:
        from console.session.preview import preview

        try:
            self._answer = (question, preview(*question), ())
        except ProblemError as error:
            self._answer = (question, None, tuple(error.problems))
        except Exception as fault:
            what = " ".join(f"{type(fault).__name__}: {fault}".split())
            self._answer = (question, None, (Problem(code="session.fault", value=what),))
