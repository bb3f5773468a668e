"""One cell of the headless matrix: one fault at one moment of one part (`cut_part`), and how the part ends."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from signal import SIGINT
from typing import cast

from console.session.cut.engine import CutContext, Step
from console.session.cut.run import cut_part
from console.session.errors import Interrupted
from console.session.signals import Interruption
from console.session.station.owning import Owning
from console.session.station.reaching import guard, leave
from drivers.cutting.planning import CutPlan, Strategy
from drivers.errors import DriverError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.problem import ProblemError
from profiles.traces import Trace
from tests.branching import Branching
from tests.matrix.cell import NO_ANSWER
from tests.matrix.checks import (
    Kind,
    after_stop,
    energised,
    kind_of,
    misread,
    restless,
    slow_to_repeat,
    slow_to_stop,
    unasked,
)
from tests.matrix.faults import NO_FAULT, Row
from tests.matrix.rig import Watched, build_watched, compact_machine, planned_once, short_job
from tests.matrix.truth import Sent

BEGUN_MM, MADE_MM = 0.1, 0.3
"""How far the carriage is when the cut goes on, and when the rest of it is the way out."""

CLEAR_COUNTS = 50.0
RELAXED = 3.0
"""How many times the jitter an axis may go when its drive is switched off, and friction lets it."""


INTERRUPT = Row(name="an interrupt", fault="")
"""Somebody presses Ctrl-C where the command was given: no fault of the machine."""


class Moment(StrEnum):
    """Where a part is when the fault comes."""

    CLAIMING = "claiming"
    LOADING = "loading"
    HOMING = "homing"
    POSITIONING = "positioning"
    CHECKING = "checking"
    STARTING = "starting"
    CUTTING = "cutting"
    RETRACTING = "retracting"
    ENDED = "ended"


MOVING = frozenset({Moment.HOMING, Moment.POSITIONING, Moment.CUTTING, Moment.RETRACTING})


class End(StrEnum):
    """How it ends: a part; nothing has moved, twice; stopped, and proven to rest; stopped, and nobody knows."""

    CUT = "cut"
    REFUSED = "refused"
    INTERRUPTED = "interrupted"
    STOPPED = "stopped"
    UNPROVEN = "unproven"


UNTOUCHED = (End.REFUSED, End.INTERRUPTED)


@dataclass(frozen=True, kw_only=True)
class Part:
    """How a part has ended, why, and what was sent for it since the fault came. `lines` are those of all of it."""

    end: End
    codes: tuple[str, ...]
    sent: tuple[Kind, ...]
    lines: tuple[str, ...]
    wrong: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Way:
    """How a part is made up to its fault; that of an `early` one is none."""

    moment: Moment
    strategy: Strategy
    early: bool


_WAYS: dict[Way, Branching[Row, Part]] = {}


class Made:
    """A part that is being made, with a fault that happens once."""

    def __init__(self, which: Callable[[], Row], way: Way, records: Path) -> None:
        """`which` is asked for the fault when it is to happen."""
        self.watched = build_watched()
        self.wrong: list[str] = []
        self.at_s: float | None = None
        self.measured = False
        self.plan: CutPlan = planned_once(short_job(), compact_machine().machine, way.strategy)
        self.row = NO_FAULT
        self._which, self._way, self._step = which, way, Step.LOAD
        lathe, wire = self.watched.lathe, self.watched.wire
        self.owning = Owning(lathe, wire.address, records)
        self.watched.looks += [self._look, lambda seen: self.wrong.extend(misread(self.watched, seen))]
        wire.before = self._line
        self._interruption = Interruption()
        guard(self._interruption, lathe, self.watched.sim.now_s)

    def cut(self) -> tuple[End, tuple[str, ...]]:
        """Make it; return how it has ended, and why."""
        watched = self.watched
        context = CutContext(lathe=watched.lathe, workshop=self, admit=self.owning.claim)
        if self._way.early:
            self._happen()
        try:
            cut_part(context, short_job(), self.plan, self._told)
        except ProblemError as error:
            codes = tuple(dict.fromkeys(problem.code for problem in error.problems))
            if watched.stop.reason is None:
                return End.REFUSED, codes
            return End.UNPROVEN if "machine.state_unknown" in codes else End.STOPPED, codes
        except Interrupted:
            return End.INTERRUPTED, ()
        return End.CUT, ()

    def _happen(self) -> None:
        if self.at_s is None:
            self.at_s = self.watched.sim.now_s()
            self.row = self._which()
            self.row.inject(self.watched.sim)
            if self.row == INTERRUPT:
                self._interruption.end(SIGINT.name)

    def mount(self, job: Job) -> None:
        self.watched.sim.mount(job)

    def measure(self) -> Trace:
        self.measured = True
        return cast(Trace, None)

    def indicate(self, places: int | None = None) -> ClampReadings:
        return self.watched.sim.indicate(places)

    def look(self) -> WorkshopView:
        return self.watched.sim.look()

    def set_spindle(self, rpm: float | None) -> None:
        self.watched.sim.set_spindle(rpm)

    def _told(self, step: Step, _: str) -> None:
        self._step = step
        if _BEGINNING.get(step) is self._way.moment:
            self._happen()

    def _line(self, sent: Sent) -> None:
        path = self._way.moment is Moment.LOADING and sent.line.startswith("PVT")
        if path or self._way.moment is Moment.CLAIMING:
            self._happen()

    def _look(self, seen: Snapshot) -> None:
        met = _CONDITIONS.get(self._way.moment)
        if met is not None and met(self._step, seen, self.plan):
            self._happen()


def _cutting(step: Step, seen: Snapshot, plan: CutPlan) -> bool:
    return step is Step.CUT and seen.program_running and _behind_mm(seen, plan) > BEGUN_MM


def _retracting(step: Step, seen: Snapshot, plan: CutPlan) -> bool:
    out = seen.tool.commanded < plan.setup.surface - CLEAR_COUNTS
    return step is Step.CUT and seen.program_running and out and _behind_mm(seen, plan) > MADE_MM


def _behind_mm(seen: Snapshot, plan: CutPlan) -> float:
    return (seen.carriage.commanded - plan.carriage_start) / compact_machine().machine.carriage.counts_per_mm


_BEGINNING = {Step.ARM: Moment.CHECKING, Step.CUT: Moment.STARTING, Step.RETRACT: Moment.ENDED}
"""The moments with which a step begins: its first line is yet to come."""

_CONDITIONS: dict[Moment, Callable[[Step, Snapshot, CutPlan], bool]] = {
    Moment.HOMING: lambda step, seen, _: "home_search" in seen.tool.flags,
    Moment.POSITIONING: lambda step, seen, _: (
        step is Step.ALIGN and seen.homed and "desired_velocity_zero" not in seen.carriage.flags
    ),
    Moment.CUTTING: _cutting,
    Moment.RETRACTING: _retracting,
}


def make(row: Row, moment: Moment, records: Path) -> Part:
    """Make a part with a fault, mend it, look on, and leave the machine as the command does.

    The way to the fault is made once, and gone on from for each.
    """
    way = Way(moment=moment, strategy=row.strategy, early=row.early)
    if way.early or moment is Moment.CLAIMING:
        return _made(lambda: row, way, records)
    if way not in _WAYS:
        planned_once(short_job(), compact_machine().machine, row.strategy)
        _WAYS[way] = Branching(lambda wait: _made(wait, way, records))
    return _WAYS[way](row)


def _made(which: Callable[[], Row], way: Way, records: Path) -> Part:
    made = Made(which, way, records)
    watched = made.watched
    end, codes = made.cut()
    assert made.at_s is not None, "the fault has not happened"
    row, moment = made.row, way.moment
    everything = tuple(watched.wire.sent)
    sent = [piece for piece in everything if piece.at_s >= made.at_s]
    lost = end is End.UNPROVEN
    wrong = [*made.wrong, *restless(watched, row, lost=lost, idle=end in (End.CUT, *UNTOUCHED))]
    wrong += after_stop(everything)
    wrong += slow_to_repeat(sent, lost=lost)
    switched_on = any(piece.line.endswith("J/") for piece in sent)  # by this run, behind the fault
    if end in UNTOUCHED or not switched_on:
        wrong += energised(watched, made.at_s, row)
    if end in UNTOUCHED:
        wrong += unasked(watched.sim.since(made.at_s), row.moves)
    if moment in MOVING and NO_ANSWER & set(codes):
        wrong += slow_to_stop(sent, made.at_s)
    if "session.fault" in codes:
        wrong.append("an exception")
    if made.measured is not (end is End.CUT):
        wrong.append("the part was measured" if made.measured else "the part was not measured")
    wrong += _left(made, row)
    return Part(
        end=end,
        codes=codes,
        sent=tuple(kind for kind in Kind if kind in set(map(kind_of, sent))),
        lines=tuple(piece.line for piece in everything if kind_of(piece) is Kind.LINE),
        wrong=tuple(dict.fromkeys(wrong)),
    )


def _left(made: Made, row: Row) -> list[str]:
    """What is wrong with a machine that is left, once all is right again: it moves, or its drives are on."""
    watched, faults = made.watched, made.watched.sim.faults
    faults.clear()
    begun_s = watched.sim.now_s()
    gone = not leave(watched.lathe, made.owning)
    wrong = unasked(watched.sim.since(begun_s), {*row.moves, *_coasting(watched)}, RELAXED)
    with suppress(DriverError):
        seen = watched.lathe.snapshot()
        ours = seen.owner in (0, watched.lathe.ownership.number if watched.lathe.ownership else 0)
        if not gone and ours and watched.lathe.has_moved and not seen.loops_open:
            wrong.append("the drives are on")
    return wrong


def _coasting(watched: Watched) -> set[AxisName]:
    """A spindle whose drive is off may run out."""
    return set() if watched.sim.moments[-1].powered[1] else {AxisName.SPINDLE}
