"""One part without an operator at a screen: connect, load, clamp, home, cut, measure.

After any error with the machine connected, stop it and prove it at rest before the error is raised.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from console.session.cut.context import CutContext
from console.session.cut.engine import CutEnd, Step, cut, load, nothing_seen, tool_clear
from console.session.cut.telemetry import CutFigures
from console.session.errors import SessionError
from drivers.cutting.planning import CutPlan
from drivers.errors import LinkError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from profiles.job import Job
from profiles.problem import Problem, ProblemError
from profiles.traces import Trace


@dataclass(frozen=True, slots=True, kw_only=True)
class CutOutcome:
    """Trace of the released part, figures read during the cut, and collisions of the tool.

    Without a gauge, or where no measurement was asked for, there is no trace.
    """

    trace: Trace | None
    figures: CutFigures
    collisions: tuple[str, ...]


class Beside(Protocol):
    """Work done beside a cut: it is notified when the machine is ready, and gets every poll of the program."""

    def begin(self, plan: CutPlan) -> None:
        """Take notice that the machine is ready and at rest, and that the cut is about to start."""

    def see(self, snapshot: Snapshot) -> None:
        """Take a status poll during the cut."""


Tell = Callable[[Step, str], None]
"""Called at the beginning of every step, with a detail that needs no translation."""


@dataclass(frozen=True, slots=True)
class _Observer:
    plan: CutPlan
    tell: Tell
    beside: Beside | None

    def step(self, step: Step, detail: str) -> None:
        self.tell(step, detail)
        if step is Step.CUT and self.beside is not None:
            self.beside.begin(self.plan)

    def see(self, snapshot: Snapshot) -> None:
        if self.beside is not None:
            self.beside.see(snapshot)


def cut_part(
    context: CutContext,
    job: Job,
    plan: CutPlan,
    tell: Tell,
    beside: Beside | None = None,
    *,
    homed: bool = False,
    blank: bool = True,
    measured: bool = True,
) -> CutOutcome:
    """Make one part, with the work `beside` it; a machine that is `homed` is not homed again.

    Without a `blank` it is an air cut, clear of what is clamped. A part not to be `measured` stays clamped.

    Raises:
        ProblemError: what went wrong, or who stopped it; the machine is at rest, or the problems say that this
            could not be proven. What is refused before any motion leaves the machine alone.
    """
    lathe, observer = context.lathe, _Observer(plan, tell, beside)
    version, kind = lathe.connect()
    try:
        context.admit()
        tell(Step.LOAD, f"{kind} {version}")
        load(context, plan, observer, aligned=False)
        tell(Step.ALIGN, "")
        _switch_on(context, job, homed=homed, blank=blank)
        end = cut(context, job, plan, observer, settle_tool=not homed)
        return _outcome(context, job, end, tell, measured=measured and blank)
    except ProblemError as error:
        if lathe.stop.reason is None and not lathe.has_moved:
            raise
        raise _left_at_rest(lathe, plan, error) from error
    except Exception as fault:
        # A fault of the console itself must stop the machine too.
        what = " ".join(f"{type(fault).__name__}: {fault}".split())
        unexpected = SessionError(Problem(code="session.fault", value=what))
        raise _left_at_rest(lathe, plan, unexpected) from fault


def _switch_on(context: CutContext, job: Job, *, homed: bool, blank: bool) -> None:
    """Clamp the blank, enable the drives, and home the axes."""
    lathe = context.lathe
    if context.workshop is not None and blank:
        context.workshop.mount(job)
    lathe.snapshot()  # loading and clamping take time: another console may have taken control
    lathe.enable()
    if not homed:
        lathe.home()


def _outcome(context: CutContext, job: Job, end: CutEnd, tell: Tell, *, measured: bool) -> CutOutcome:
    if end.figures is None:
        raise SessionError(nothing_seen(job))
    workshop, trace = context.workshop, None
    if workshop is not None and measured:
        tell(Step.MEASURE, "")
        trace = workshop.measure()
    met = () if workshop is None else workshop.look().collisions
    return CutOutcome(trace=trace, figures=end.figures, collisions=met)


def _left_at_rest(lathe: Lathe, plan: CutPlan, error: ProblemError) -> SessionError:
    """Stop, wait for rest, and return the error to raise, with what the operator must know of the machine."""
    if lathe.anothers:
        return SessionError(*error.problems)
    if isinstance(error, LinkError):
        lathe.in_doubt()
    if lathe.stop.reason is None:
        lathe.stop.stop(error.problems[0].code)
    try:
        snapshot = lathe.wait_for_rest()
    except ProblemError as unproven:
        return SessionError(*error.problems, *unproven.problems, Problem(code="machine.state_unknown"))
    with suppress(ProblemError):
        # The machine is at rest, and the first error is what matters: the next cut would find the others.
        lathe.program.put_back()
    if not snapshot.homed:
        return SessionError(*error.problems, Problem(code="machine.tool_unknown"))
    if not tool_clear(snapshot, plan):
        # The tool may be in the part: report it, and whether the machine can retract it.
        code = "machine.tool_in_part" if snapshot.loops_closed else "machine.retract_not_possible"
        return SessionError(*error.problems, Problem(code=code))
    return SessionError(*error.problems)
