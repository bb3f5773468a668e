"""One cut from a clamped blank to a measured part: load, check, align, arm, cut, retract, measure.

Whatever goes wrong after the machine is there, it is stopped and proven to rest before the error leaves here.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from console.session.cut.interlocks import SPEED_BAND, Interlock, at_speed, of_machine, refuse_unless
from console.session.cut.planned_cut import PlannedCut, refuse_unless_held
from console.session.cut.telemetry import CutFigures, Telemetry
from console.session.errors import SessionError
from drivers.cutting.planning import CutPlan
from drivers.errors import DriverError, LinkError
from drivers.lathe.lathe import SPEED_S, Lathe
from drivers.lathe.lengths import Lengths
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.traces import Trace

TIME_ALLOWANCE = 1.5
EXTRA_TIME_S = 5.0
RETRACT_BAND_COUNTS = 50.0
TURN_TIMEOUT_S = 120.0
STILL_RPM = 0.1


class Step(StrEnum):
    """The steps in their order."""

    LOAD = "load"
    CHECK = "check"
    ALIGN = "align"
    ARM = "arm"
    CUT = "cut"
    RETRACT = "retract"
    MEASURE = "measure"


@dataclass(frozen=True, slots=True, kw_only=True)
class Shop:
    """A machine with a way to clamp a new blank and to measure the part that comes off; None: the operator does.

    `collisions` says what the tool has run into since that was clamped, as far as somebody can tell. `turn` sets a
    spindle that the controller does not turn, rpm, None is off; without it somebody else does. `admit` is called
    once the machine answers, before anything is written; `judge` says before the cut what is against it.
    """

    lathe: Lathe
    clamp: Callable[[Job], None]
    measure: Callable[[], Trace] | None
    simulated: bool
    collisions: Callable[[], tuple[str, ...]] = tuple
    turn: Callable[[float | None], None] | None = None
    admit: Callable[[], None] = lambda: None
    judge: Callable[[], Interlock] = lambda: Interlock(name="commissioned")


@dataclass(frozen=True, slots=True, kw_only=True)
class CutOutcome:
    """The trace of the released part, the figures read during the cut, and what the tool has run into.

    Without a gauge there is no trace.
    """

    trace: Trace | None
    figures: CutFigures
    collisions: tuple[str, ...]


class Beside(Protocol):
    """What goes on beside a cut: it is told when the program is loaded and of every look during it."""

    def begin(self, plan: CutPlan) -> None:
        """The machine is ready and rests; the cut is about to start."""

    def see(self, snapshot: Snapshot) -> None:
        """A look at the machine during the cut."""


Tell = Callable[[Step, str], None]
"""Told at the beginning of every step, with a detail that needs no translation."""


def cut_part(
    shop: Shop, job: Job, plan: CutPlan, tell: Tell, beside: Beside | None = None, *, homed: bool = False
) -> CutOutcome:
    """Make one part, and whatever goes on `beside` it; a machine that is `homed` is not homed once more.

    Raises:
        ProblemError: what went wrong, or who stopped it; the machine is at rest, or the problems say that this
            could not be proven. What is refused before anything moved leaves the machine alone.
    """
    lathe = shop.lathe
    version, kind = lathe.connect()
    try:
        shop.admit()
        tell(Step.LOAD, f"{kind} {version}")
        _prepare(lathe, plan, tell)
        return _steps(shop, job, plan, tell, beside, homed=homed)
    except ProblemError as error:
        if lathe.stop.reason is None and not lathe.has_moved:
            raise
        raise _left_at_rest(lathe, plan, error) from error
    except Exception as fault:
        # A fault of the console itself is no reason for the machine to go on.
        what = " ".join(f"{type(fault).__name__}: {fault}".split())
        unexpected = SessionError(Problem(code="session.fault", value=what))
        raise _left_at_rest(lathe, plan, unexpected) from fault


def _prepare(lathe: Lathe, plan: CutPlan, tell: Tell) -> None:
    """Load the program and look at the settings; nothing moves."""
    refuse_unless(Interlock(name="no_table", problems=lathe.tables_left()))
    lathe.load(plan.program, plan.axis_definitions)
    tell(Step.CHECK, f"PROG {plan.program.number}")
    refuse_unless(Interlock(name="controller_verified", problems=lathe.verify()))


def _steps(shop: Shop, job: Job, plan: CutPlan, tell: Tell, beside: Beside | None, *, homed: bool) -> CutOutcome:
    lathe = shop.lathe
    tell(Step.ALIGN, "")
    _align(shop, job, plan, homed=homed)
    _turn(shop, job.spindle_speed_rpm)
    tell(Step.ARM, f"{plan.spindle_speed_rpm:.6g} rpm")
    ready = of_machine(lathe.snapshot(), plan, lathe.machine, lathe.verify())
    refuse_unless(*ready, shop.judge(), at_speed(lathe, job))
    refuse_unless_held(lathe, plan)
    tell(Step.CUT, f"{plan.duration_s:.1f} s")
    planned = PlannedCut(lathe, plan)
    figures = _cut(lathe, job, plan, planned, beside)
    lathe.restore(plan.restore)
    _refuse_another_cut(planned)
    if figures is None:
        value = f"{job.cut_length_mm:g} mm"
        raise SessionError(Problem(code="session.nothing_seen", key="cut_length_mm", value=value))
    refuse_unless(Interlock(name="no_table", problems=lathe.tables_left()))
    tell(Step.RETRACT, "")
    _prove_retracted(lathe, plan)
    _turn(shop, 0.0)
    lathe.stop.check()  # a stop in the last moment is not to be lost in a report
    trace = None
    if shop.measure is not None:
        tell(Step.MEASURE, "")
        trace = shop.measure()
    return CutOutcome(trace=trace, figures=figures, collisions=shop.collisions())


def _align(shop: Shop, job: Job, plan: CutPlan, *, homed: bool) -> None:
    """Drives on, home, and every axis to its start: tool last, so that it comes in beside the part."""
    lathe = shop.lathe
    shop.clamp(job)
    lathe.snapshot()  # loading and clamping take their time: the machine may be another's by now
    lathe.enable()
    if not homed:
        lathe.home()
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    if AxisName.SPINDLE in lathe.driven:
        lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    # Behind a cut the tool is there already, with its integrator as the cut has left it.
    lathe.jog_to(AxisName.TOOL, plan.tool_start, settle=not homed)


def _turn(shop: Shop, speed_rpm: float) -> None:
    """Set a spindle that the controller does not turn, and wait for its speed; 0 is off."""
    if shop.turn is None:
        return
    shop.turn(speed_rpm or None)
    for _ in range(round(TURN_TIMEOUT_S / SPEED_S)):
        if abs(shop.lathe.spindle_rpm() - speed_rpm) <= max(SPEED_BAND * speed_rpm, STILL_RPM):
            return


def _refuse_another_cut(planned: PlannedCut) -> None:
    """Refuse to go on with a cut that is not the one that was planned: it is neither measured nor learned from.

    Raises:
        DriverError: by what it differs, and who has ended it where that is known.
    """
    problems = planned.problems()
    if problems:
        raise DriverError(*problems)


def _cut(lathe: Lathe, job: Job, plan: CutPlan, planned: PlannedCut, beside: Beside | None) -> CutFigures | None:
    telemetry = Telemetry(plan, lathe.machine, job.cut_length_mm)

    def see(snapshot: Snapshot) -> None:
        telemetry.see(snapshot)
        planned.see(snapshot)
        if beside is not None:
            beside.see(snapshot)

    if beside is not None:
        beside.begin(plan)
    lathe.start(plan.program.number, plan.setup.retracted)
    lathe.follow(see, plan.duration_s * TIME_ALLOWANCE + EXTRA_TIME_S, planned.guard)
    return telemetry.figures()


def _prove_retracted(lathe: Lathe, plan: CutPlan) -> None:
    """The program takes the tool out; the controller must say that it is there and that nothing moves."""
    snapshot = lathe.snapshot()
    if not snapshot.at_rest or not tool_clear(snapshot, plan):
        raise SessionError(not_retracted(snapshot, plan, lathe.machine))


def not_retracted(snapshot: Snapshot, plan: CutPlan, machine: MachineProfile) -> Problem:
    """Return that the tool is not out of the part, where it stands, and what would be clear of it."""
    value, limit = (Lengths(machine).at(AxisName.TOOL, at) for at in (snapshot.tool.position, _clear_of(plan)))
    return Problem(code="machine.not_retracted", key=AxisName.TOOL, value=value, limit=f"< {limit}")


def _clear_of(plan: CutPlan) -> float:
    return plan.setup.surface - RETRACT_BAND_COUNTS


def tool_clear(snapshot: Snapshot, plan: CutPlan) -> bool:
    """Whether the tool is out of the part of this cut."""
    return snapshot.tool.position < _clear_of(plan)


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
        # The machine rests, and what went wrong is what matters: the next cut would find the rest.
        lathe.restore(plan.restore)
    if not snapshot.homed:
        return SessionError(*error.problems, Problem(code="machine.tool_unknown"))
    if not tool_clear(snapshot, plan):
        # The tool may be in the part: say so, and whether the machine can take it out.
        code = "machine.tool_in_part" if snapshot.loops_closed else "machine.retract_not_possible"
        return SessionError(*error.problems, Problem(code=code))
    return SessionError(*error.problems)
