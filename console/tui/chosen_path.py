"""The path that the job in hand is cut with, for its preview: the same object while nothing of it is changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from console.session.alignment import Alignment, aligned_job, aligned_machine
from console.session.work import Work
from profiles.problem import ProblemError

if TYPE_CHECKING:
    from profiles.compensation import CutPath


class ChosenPath:
    """Remembers the last one; `of` is called at every tick."""

    def __init__(self) -> None:
        self._made_of: tuple[Any, ...] = ()
        self._path: CutPath | None = None

    def of(self, work: Work, alignment: Alignment, *, simulated: bool) -> CutPath | None:
        """Return the path of compensation and stage, None for that of the model, and for what may not be cut."""
        if work.compensation is None and work.stage != "partial":
            return None
        # Tuples ask first whether they are the same objects, which is what they are from tick to tick.
        made_of = (work.job, work.loaded, work.strategy, work.stage, work.compensation, alignment, simulated)
        if made_of != self._made_of:
            self._made_of, self._path = made_of, _path(work, alignment, simulated=simulated)
        return self._path


def _path(work: Work, alignment: Alignment, *, simulated: bool) -> CutPath | None:
    # Numerics, which the first page does without.
    from console.session.compensated import chosen_problems, path_of
    from console.session.stages import Stage
    from drivers.cut import Strategy

    if chosen_problems(work, simulated=simulated):
        return None
    job, machine = aligned_job(work.job, alignment), aligned_machine(work.machine.machine, alignment)
    try:
        return path_of(job, work.job, machine, Strategy(work.strategy), Stage(work.stage), work.compensation)
    except ProblemError:
        return None  # the preview of the model fails for the same reason, and tells it
