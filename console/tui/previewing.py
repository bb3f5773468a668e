"""Background computation of the open job's preview: its outlook at once, its programs one by one.

The screen asks at every tick, and gets immutable objects. The two threads share the newest question, the fault of
one, and the finished programs, each in a place of its own. The path of the job stays the same object while
nothing of it is changed.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from console.session.cut.alignment import Alignment, aligned_job, aligned_machine
from console.session.errors import fault_problem
from console.session.work import Work
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    from drivers.cutting.strategy import Strategy
    from drivers.preview.outlook import Outlook
    from drivers.preview.preview import PartialPreview, Preview, Program, ProgramInput
    from profiles.axis.response import ServoResponse
    from profiles.compensations.learned_compensation import ExpectedPart
    from profiles.compensations.path import CutPath

Key = TypeVar("Key")
Value = TypeVar("Value")
PROGRAMS_KEPT = 60  # those of a dozen jobs, between which an operator steps back and forth


class ValueCache(Generic[Key, Value]):
    """Cache of the last `most` values, for two threads. Keys are compared: a profile with tables has no hash."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._entries: list[tuple[Key, Value]] = []

    def find(self, key: Key) -> Value | None:
        """Return the value kept under an equal key."""
        with self._lock:
            for place in range(len(self._entries) - 1, -1, -1):
                if self._entries[place][0] == key:
                    self._entries.append(self._entries.pop(place))
                    return self._entries[-1][1]
            return None

    def keep(self, key: Key, value: Value) -> None:
        """Keep a value."""
        with self._lock:
            self._entries.append((key, value))
            del self._entries[: -self._most]


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewQuestion:
    """What is to be predicted; `path` is that of a cut with `strategy`, None for the model's.

    `taught` is the result expected from the part that the path was learned from. `response` is the identified one
    that the path inverts, None the model's. A cut `in_air` has its program further out.
    """

    job: Job
    machine: MachineProfile
    strategy: str
    path: CutPath | None = None
    taught: ExpectedPart | None = None
    response: ServoResponse | None = None
    in_air: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Begun:
    """A question, its outlook or the `problems` of it, and its programs (`asked`), that of its strategy first."""

    question: PreviewQuestion
    outlook: Outlook | None = None
    asked: tuple[ProgramInput, ...] = ()
    problems: tuple[Problem, ...] = ()


class Previewer:
    """Answer the newest question; `refresh_work` is called at every tick, by the thread of the screen alone."""

    def __init__(self) -> None:
        self._programs: ValueCache[ProgramInput, Program] = ValueCache(PROGRAMS_KEPT)
        self._begun: _Begun | None = None
        self._fault: tuple[_Begun, Problem] | None = None
        self._shown: tuple[_Begun, dict[Strategy, Program], PartialPreview] | None = None
        self._settled: tuple[Work, Alignment, CutPath | None] | None = None
        self._thread: threading.Thread | None = None

    def refresh_work(self, work: Work, alignment: Alignment, *, path: CutPath | None = None) -> Work:
        """Return the work with what is known of exactly this job, aligned, so far; begin to compute the rest."""
        asked = (work, alignment, path)
        if self._settled is not None and all(a is b for a, b in zip(self._settled, asked, strict=True)):
            return work
        question = PreviewQuestion(
            job=aligned_job(work.job, alignment),
            machine=aligned_machine(work.machine.machine, alignment),
            strategy=work.strategy,
            path=path,
            taught=None if path is None else _expected_part(work, alignment),
            response=_load_inverted_response(work),
            in_air=work.stage == "air",
        )
        answered = self._answer_question(work, question)
        done = answered.preview is not None or answered.preview_problems
        self._settled = (answered, alignment, path) if done else None
        return answered

    def _answer_question(self, work: Work, question: PreviewQuestion) -> Work:
        begun = self._begun
        if begun is None or begun.question != question:
            begun = self._begun = _begin(question)
        problems = begun.problems
        if self._fault is not None and self._fault[0] is begun:
            problems = (self._fault[1],)
        if begun.outlook is None or problems:
            return replace(work, outlook=None, preview=None, preview_problems=problems)
        seen, preview = self._known_preview(begun, begun.outlook)
        if work.outlook is not seen:
            return replace(work, outlook=seen, preview=preview, preview_problems=())
        if preview is None and (self._thread is None or not self._thread.is_alive()):
            # Not before the page was drawn once: both threads need the one interpreter.
            self._thread = threading.Thread(target=self._compute, name="preview", daemon=True)
            self._thread.start()
        return work

    def _known_preview(self, begun: _Begun, outlook: Outlook) -> tuple[PartialPreview, Preview | None]:
        """Return the answer so far, the same object until something is added; and as the whole, if complete."""
        from drivers.preview.preview import Preview, complete_preview, underway

        found = ((each.strategy, self._programs.find(each)) for each in begun.asked)
        programs = {each: program for each, program in found if program is not None}
        shown = self._shown
        if shown is None or shown[0] is not begun or shown[1] != programs:
            if len(programs) == len(begun.asked):
                seen: PartialPreview = complete_preview(outlook, programs)
            else:
                seen = underway(outlook, programs)
            shown = self._shown = (begun, programs, seen)
        return shown[2], shown[2] if isinstance(shown[2], Preview) else None

    def _compute(self) -> None:
        """Compute in the other thread what is missing from the newest question, until nothing is."""
        while (begun := self._begun) is not None:
            try:
                if not self._add_to(begun):
                    return
            except Exception as fault:
                self._fault = (begun, fault_problem(fault))
                return

    def _add_to(self, begun: _Begun) -> bool:
        """Compute the first missing item of a question; False when nothing is missing."""
        from drivers.preview.preview import program_of

        missing = [each for each in begun.asked if self._programs.find(each) is None]
        if missing:
            self._programs.keep(missing[0], program_of(missing[0]))
        return bool(missing)


def _load_inverted_response(work: Work) -> ServoResponse | None:
    """Return the identified response of the chosen path; one of another path is refused, and not predicted."""
    chosen = work.inverts
    return None if chosen is None or chosen.identified.path.value != work.strategy else chosen.response


def _expected_part(work: Work, alignment: Alignment) -> ExpectedPart | None:
    """Return what a part has taught of the path, with jaw 1 where it was found; None for an air cut."""
    from console.session.stages import Stage
    from profiles.compensations.learned_compensation import expected_part

    stage = Stage(work.stage)
    if work.compensation is None or stage is Stage.AIR:
        return None
    found = expected_part(work.compensation, stage.fraction)
    turn_deg = aligned_job(work.job, alignment).lobe_phase_deg - work.job.lobe_phase_deg
    return None if found is None else found.turn_by(turn_deg)


def _begin(question: PreviewQuestion) -> _Begun:
    from console.session.stages import Stage, air_mm
    from drivers.cutting.strategy import Strategy
    from drivers.preview.outlook import outlook
    from drivers.preview.preview import all_asked

    parts = (question.job, question.machine, Strategy(question.strategy), question.response)
    try:
        seen = outlook(*parts, path=question.path, taught=question.taught)
    except ProblemError as error:
        return _Begun(question=question, problems=tuple(error.problems))
    except Exception as fault:
        return _Begun(question=question, problems=(fault_problem(fault),))
    out_mm = air_mm(question.job, Stage.AIR) if question.in_air else 0.0
    asked = sorted(all_asked(*parts, question.path, out_mm), key=lambda each: each.strategy is not seen.strategy)
    return _Begun(question=question, outlook=seen, asked=tuple(asked))


class ChosenPath:
    """Cache of the last path; `path_for` is called at every tick."""

    def __init__(self) -> None:
        self._made_of: tuple[Any, ...] = ()
        self._path: CutPath | None = None

    def path_for(self, work: Work, alignment: Alignment, *, simulated: bool) -> CutPath | None:
        """Return the path of compensation and stage, None for the model's, and for one that may not be cut."""
        if work.compensation is None and work.inverts is None and work.stage != "partial":
            return None
        # Tuple comparison checks identity first, and from tick to tick the objects are the same.
        chosen = (work.strategy, work.stage, work.compensation, work.inverts)
        made_of = (work.job, work.loaded, *chosen, alignment, simulated)
        if made_of != self._made_of:
            self._made_of, self._path = made_of, _path(work, alignment, simulated=simulated)
        return self._path


def _path(work: Work, alignment: Alignment, *, simulated: bool) -> CutPath | None:
    # Loads numerics, which the first page does without.
    from console.session.cut.compensated_cut import chosen_problems, inverted_path, path_of
    from console.session.stages import Stage, scale_path_to_stage
    from drivers.cutting.strategy import Strategy

    if chosen_problems(work, simulated=simulated):
        return None
    job, machine = aligned_job(work.job, alignment), aligned_machine(work.machine.machine, alignment)
    try:
        strategy, path = Strategy(work.strategy), path_of(job, work.job, work.compensation)
        if path is None:
            path = inverted_path(job, machine, strategy, work.inverts)
        return scale_path_to_stage(job, machine, strategy, Stage(work.stage), path)
    except ProblemError:
        return None  # the preview fails for the same reason, and reports it
