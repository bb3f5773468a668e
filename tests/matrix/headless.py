"""The headless matrix: one fault at one moment of one part (`cut_part`), how it ends, and what is right there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from signal import SIGINT
from typing import cast

from console.session.cut.engine import CutContext, PartStep
from console.session.cut.run import cut_part
from console.session.errors import Interrupted
from console.session.signals import Interruption
from console.session.station.machine_connection import guard, leave
from console.session.station.machine_control import MachineControl
from drivers.cutting.planning import CutPlan, Strategy
from drivers.errors import DriverError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.compensations.trial_band import BandReadings
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.metrology.cylindricity import PartSection
from profiles.problem import ProblemError
from profiles.traces import Trace
from tests.branching import Branching
from tests.matrix.cell import (
    NO_ANSWER,
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
from tests.matrix.faults import NO_ANSWER as ANY_OF
from tests.matrix.faults import NO_FAULT, SAME, UNKNOWN, UNTRIED, Row
from tests.matrix.rig import Sent, Watched, build_watched, compact_machine, planned_once, short_job

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
        self._which, self._way, self._step = which, way, PartStep.LOAD
        lathe, wire = self.watched.lathe, self.watched.wire
        self.owning = MachineControl(lathe, wire.address, records)
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
            assert len(set(error.problems)) == len(error.problems), "the operator is told the same twice"
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

    def measure(self, *, turned_deg: float = 0.0) -> Trace:
        self.measured = True
        return cast(Trace, None)

    def sections(self) -> tuple[PartSection, ...]:
        return ()

    def indicate(self, places: int | None = None) -> ClampReadings:
        return self.watched.sim.indicate(places)

    def indicate_band(self, behind_face_mm: float) -> BandReadings:
        return self.watched.sim.indicate_band(behind_face_mm)

    def look(self) -> WorkshopView:
        return self.watched.sim.look()

    def set_spindle(self, rpm: float | None) -> None:
        self.watched.sim.set_spindle(rpm)

    def _told(self, step: PartStep, _: str) -> None:
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


def _cutting(step: PartStep, seen: Snapshot, plan: CutPlan) -> bool:
    return step is PartStep.CUT and seen.program_running and _behind_mm(seen, plan) > BEGUN_MM


def _retracting(step: PartStep, seen: Snapshot, plan: CutPlan) -> bool:
    out = seen.tool.commanded_position < plan.setup.surface - CLEAR_COUNTS
    return step is PartStep.CUT and seen.program_running and out and _behind_mm(seen, plan) > MADE_MM


def _behind_mm(seen: Snapshot, plan: CutPlan) -> float:
    return (
        seen.carriage.commanded_position - plan.carriage_start
    ) / compact_machine().machine.carriage.counts_per_mm


_BEGINNING = {PartStep.ARM: Moment.CHECKING, PartStep.CUT: Moment.STARTING, PartStep.RETRACT: Moment.ENDED}
"""The moments with which a step begins: its first line is yet to come."""

_CONDITIONS: dict[Moment, Callable[[PartStep, Snapshot, CutPlan], bool]] = {
    Moment.HOMING: lambda step, seen, _: "home_search" in seen.tool.flags,
    Moment.POSITIONING: lambda step, seen, _: (
        step is PartStep.ALIGN and seen.homed and "desired_velocity_zero" not in seen.carriage.flags
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


REFUSED = "refused, lines"
"""Nothing has moved, so nothing is stopped: what was sent is what is being loaded."""

FAULT_A, FAULT_K = "stopped, ^A: machine.fault", "stopped, ^K: machine.fault"
OPENED = "stopped, ^K: machine.loop_open"
IN_PART, NO_WAY_OUT = "machine.tool_in_part", "machine.retract_not_possible"
TOOL_UNKNOWN = "machine.tool_unknown"
"""The tool has no zero: it is being searched, or it was lost. Where the tool stands is not guessed."""

UNSEEN = f"{REFUSED}: {ANY_OF} {UNKNOWN}"
SILENT = f"unproven, ^K: {ANY_OF} machine.rest_unknown machine.state_unknown"
GONE = "unproven, ^K: link.lost machine.state_unknown"
SETTING = "stopped, ^A: controller.setting"
ANOTHER_PROGRAM = "stopped, ^A: controller.program_differs"
NOT_AS_PLANNED = "stopped, ^A: controller.constant_differs"
CHANGED_IN_CUT = "stopped, ^A: cut.constant_differs"
NOT_LOADED = f"{REFUSED}: controller.constant_differs"
ENDED_EARLY = "stopped, ^A: cut.ended_early cut.constant_changed"
OUSTED = "stopped, ^A: owner.ousted"
NOT_ENABLED = "stopped, ^K: machine.not_enabled"
"""With a loop open nothing is started; what follows must not close it."""

ENDED_BY_OTHERS = "stopped, ^A: cut.ended_early cut.stopped_by_another"
DISTURBED = "stopped, ^A: cut.disturbed"
"""The whole length is cut, and the program did not come out of the part on its own."""

OVERRIDE, OUTSIDE = "stopped, ^A: cut.override", "stopped, ^A: cut.outside_plan"
RESET = f"stopped, ^K: controller.was_reset {TOOL_UNKNOWN}"
INTERRUPTED = "stopped, ^A: machine.stopped"
STILL_MOVING = "stopped, ^A: machine.moving machine.tool_unknown"

WITHOUT: Mapping[Moment, str] = {
    moment: "cut, nothing" if moment is Moment.ENDED else "cut, lines" for moment in Moment
}
"""Once the program has ended there is only the look that proves it."""


def _row(**cells: str) -> Mapping[Moment, str]:
    return {moment: cells.get(moment.name, UNTRIED) for moment in Moment}


HEADLESS: Mapping[str, Mapping[Moment, str]] = {
    "no fault": WITHOUT,
    "dropped-ack, once": _row(LOADING=UNSEEN, CHECKING=SAME, CUTTING=SAME),
    "cut-cable": _row(
        LOADING=f"{REFUSED}: link.lost {UNKNOWN} controller.buffer_may_be_open",
        POSITIONING=GONE,
        CUTTING=GONE,
        ENDED=GONE,
    ),
    "hang": _row(
        LOADING=f"{UNSEEN} link.not_in_step controller.buffer_may_be_open",
        POSITIONING=SILENT,
        CUTTING=SILENT,
    ),
    # Behind the end the tool is out, the part is made, and the drives go off.
    "amplifier-fault, tool": _row(
        LOADING=f"stopped, ^K: machine.not_enabled {TOOL_UNKNOWN}",
        HOMING=f"{FAULT_K} {TOOL_UNKNOWN}",
        POSITIONING=FAULT_K,
        CHECKING="stopped, ^K: machine.not_enabled machine.fault",
        STARTING=NOT_ENABLED,
        CUTTING=f"{FAULT_K} {NO_WAY_OUT}",
        RETRACTING=FAULT_K,
        ENDED=SAME,
    ),
    # An axis may stand on a limit and move off it; the other way it does not arrive.
    "limit, carriage positive": _row(
        LOADING="stopped, ^A: machine.fault",
        POSITIONING=FAULT_A,
        CHECKING=FAULT_A,
        STARTING=FAULT_A,
        CUTTING=f"{FAULT_A} {IN_PART}",
    ),
    "stranger-writes, a gain": _row(
        LOADING=f"{REFUSED}: controller.setting",
        POSITIONING=SETTING,
        CHECKING=SETTING,
        STARTING=f"{CHANGED_IN_CUT} or {CHANGED_IN_CUT} {IN_PART}",
        CUTTING=f"{CHANGED_IN_CUT} {IN_PART}",
    ),
    # Nothing is sent to the machine of another console, but the stop of what this one has moved.
    "stranger-writes, another owner": _row(
        LOADING=f"{REFUSED}: owner.held",
        HOMING=f"{OUSTED} {TOOL_UNKNOWN}",
        POSITIONING=OUSTED,
        CHECKING="refused, nothing: owner.held",
        STARTING=f"{OUSTED} or refused, nothing: owner.held",
        CUTTING=f"{OUSTED} {IN_PART}",
    ),
    "stranger-writes, a jog": _row(
        HOMING=f"stopped, ^A: machine.unexpected_motion {TOOL_UNKNOWN}",
        POSITIONING="stopped, ^A: machine.not_arrived or stopped, ^A: machine.jog_astray",
        CHECKING=STILL_MOVING,
        STARTING="stopped, ^A: controller.err001",
        ENDED="stopped, ^A: machine.not_retracted",
    ),
    "stranger-writes, a jog without end": _row(POSITIONING="stopped, ^A: machine.jog_astray"),
    "stranger-writes, a jog of the tool": _row(
        HOMING=f"stopped, ^A: machine.home_ended {TOOL_UNKNOWN}",
        POSITIONING="stopped, ^A: machine.unexpected_motion",
    ),
    "stranger-writes, a kill of the tool": _row(
        POSITIONING=OPENED, CHECKING=NOT_ENABLED, STARTING=NOT_ENABLED, CUTTING=SAME
    ),
    "stranger-writes, ^K": _row(
        HOMING=f"{OPENED} {TOOL_UNKNOWN}",
        POSITIONING=OPENED,
        CHECKING="stopped, ^K: machine.not_enabled",
        STARTING=NOT_ENABLED,
        CUTTING=f"{OPENED} {NO_WAY_OUT}",
        RETRACTING=OPENED,
        ENDED=SAME,
    ),
    "stranger-writes, ^A": _row(
        HOMING=f"stopped, ^A: machine.home_ended {TOOL_UNKNOWN}",
        POSITIONING="stopped, ^A: machine.not_arrived",
        CHECKING=SAME,
        CUTTING=f"{ENDED_BY_OTHERS} {IN_PART}",
        RETRACTING=DISTURBED,
    ),
    "stranger-writes, &1A": _row(CUTTING=f"{ENDED_BY_OTHERS} {IN_PART}"),
    # What is in full motion when its segment ends runs on, into the part or out of it.
    "stranger-writes, &1Q": _row(
        CUTTING=" or ".join((ENDED_BY_OTHERS, f"{ENDED_BY_OTHERS} {IN_PART}", f"{OUTSIDE} {IN_PART}", OUTSIDE)),
        RETRACTING=f"{DISTURBED} or {OUTSIDE}",  # the segment in progress may be the last, and end in full motion
    ),
    "stranger-writes, &1H": _row(CUTTING=f"{OVERRIDE} {IN_PART}"),
    "stranger-writes, &1%0": _row(CUTTING=f"{OVERRIDE} {IN_PART}"),
    # An override from before the start is met at the first look of the program.
    "stranger-writes, &1%50": _row(CHECKING=OVERRIDE, CUTTING=f"{OVERRIDE} {IN_PART}"),
    # In the first search nothing was homed yet, and no position is lost.
    "stranger-writes, $$$": _row(
        LOADING=UNSEEN,
        HOMING=f"{OPENED} {TOOL_UNKNOWN}",
        POSITIONING=RESET,
        CHECKING="stopped, ^K: machine.not_enabled machine.not_homed machine.not_at_start machine.tool_unknown",
        STARTING=f"{NOT_ENABLED} {TOOL_UNKNOWN}",
        CUTTING=RESET,
        RETRACTING=RESET,
    ),
    # The program takes its flag back where it begins.
    "stranger-writes, M26=1": _row(STARTING=SAME, CUTTING="stopped, ^A: cut.ended_early cut.held_by_another"),
    "stranger-writes, fewer turns": _row(
        LOADING=NOT_LOADED,
        POSITIONING=NOT_AS_PLANNED,
        STARTING=CHANGED_IN_CUT,
        # With so few turns left the feed may be over, and the tool out, when it is read.
        CUTTING=f"{CHANGED_IN_CUT} {IN_PART} or {CHANGED_IN_CUT} or {ENDED_EARLY}",
    ),
    "stranger-writes, a deeper cut": _row(
        LOADING=NOT_LOADED,
        POSITIONING=NOT_AS_PLANNED,
        STARTING=f"{CHANGED_IN_CUT} or {OUTSIDE} {IN_PART}",
        CUTTING=f"{OUTSIDE} {IN_PART} or {CHANGED_IN_CUT} {IN_PART}",
        RETRACTING=CHANGED_IN_CUT,
    ),
    "stranger-writes, a larger lobe": _row(
        POSITIONING=NOT_AS_PLANNED, CUTTING=f"{OUTSIDE} {IN_PART} or {CHANGED_IN_CUT} {IN_PART}"
    ),
    # A program that is rewritten behind the last comparison runs, and is stopped where it leaves the plan.
    "stranger-writes, another program": _row(
        LOADING=SAME, POSITIONING=ANOTHER_PROGRAM, CHECKING=ANOTHER_PROGRAM, STARTING=OUTSIDE, CUTTING=SAME
    ),
    "garbled-line, a home search": _row(HOMING=f"stopped, ^A: machine.unexpected_motion {TOOL_UNKNOWN}"),
    "garbled-line, a jog": _row(POSITIONING="stopped, ^A: machine.jog_astray"),
    "garbled-line, a depth": _row(LOADING=NOT_LOADED),
    "garbled-line, an entry of a table": _row(LOADING=f"{REFUSED}: controller.table_differs"),
    # Nobody is to be stopped by who does not have the machine. A stop while the drives are off is a kill.
    INTERRUPT.name: _row(
        CLAIMING="interrupted, nothing",
        LOADING="stopped, ^K: machine.stopped machine.tool_unknown",
        HOMING=f"{INTERRUPTED} {TOOL_UNKNOWN}",
        POSITIONING=INTERRUPTED,
        CUTTING=f"{INTERRUPTED} {IN_PART}",
        ENDED=INTERRUPTED,
    ),
}

KNOWN: Mapping[tuple[str, Moment], str] = {
    (INTERRUPT.name, Moment.LOADING): "A download that is interrupted is sent to its end; nothing moves by it.",
}
"""What is not yet as it should be, and where. A cell that has become right must leave."""

TRIED = tuple(
    (name, moment)
    for name, cells in HEADLESS.items()
    for moment, said in cells.items()
    if said != UNTRIED and (name != "no fault" or moment is Moment.CUTTING)
)
"""Without a fault each of them is the same part."""


def right_of(row: str, moment: Moment) -> str:
    """Return what is right in a cell, with what happens without a fault where that is meant."""
    said = HEADLESS[row][moment]
    return WITHOUT[moment] if said == SAME else said
