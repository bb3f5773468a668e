"""The limits on a running cut from its plan, and whether the cut was made as planned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from drivers.cutting.live_trim import commanded_amplitude
from drivers.cutting.planning import CutPlan
from drivers.lathe.guards import AxisRange, ProgramGuard
from drivers.lathe.lengths import Lengths
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.axes import read_definitions
from drivers.pmac.programs.pvt import MOST_GAIN_PERCENT
from profiles.machine import MachineProfile
from profiles.problem import Problem

TOOL_MARGIN_UM = 30.0  # margin beyond the planned extent: a trim within the cut, and the rounding of a table
CARRIAGE_MARGIN_MM = 0.1
SPINDLE_MARGIN_DEG = 5.0
LENGTH_MARGIN_MM = 0.2  # how much less travel may be seen than planned: the carriage stops between two polls


def cut_guard(plan: CutPlan, machine: MachineProfile) -> ProgramGuard:
    """Return the guard that judges each poll of this cut: the program's axes within their extent and a margin."""
    programmed = {definition.motor for definition in read_definitions(plan.axis_definitions)}
    tool, spindle, carriage, checked = machine.tool, machine.spindle, machine.carriage, plan.checked
    most_trim = MOST_GAIN_PERCENT / 100.0 if plan.strategy.traits.live_trim else 0.0
    trim = most_trim * commanded_amplitude(plan, machine)
    margins = (
        (AxisName.TOOL, tool.motor, TOOL_MARGIN_UM / tool.count_um + trim),
        (AxisName.SPINDLE, spindle.motor, SPINDLE_MARGIN_DEG / 360.0 * spindle.counts_per_rev),
        (AxisName.CARRIAGE, carriage.motor, CARRIAGE_MARGIN_MM * carriage.counts_per_mm),
    )
    ranges = [
        AxisRange(axis=axis, low=checked.lowest[motor] - margin, high=checked.highest[motor] + margin)
        for axis, motor, margin in margins
        if motor in programmed
    ]
    return ProgramGuard(Lengths(machine), ranges, real_time=not plan.strategy.traits.spindle_time)


def further_held(plan: CutPlan, machine: MachineProfile, held_turns: int) -> dict[AxisName, float]:
    """Return how far beyond its range a resumed cut may take its axes, counts: by `held_turns`, and one segment.

    A cut ends at the segment nearest to the end of its last turn. Those of a resumed cut are not the planned ones:
    the planned end may be half a segment before that of the turn, and the other one half a segment behind it.
    """
    segment_turns = plan.segment_ms * plan.spindle_speed_rpm / 60_000.0
    return {
        AxisName.SPINDLE: (held_turns + segment_turns) * machine.spindle.counts_per_rev,
        AxisName.CARRIAGE: segment_turns * plan.setup.carriage_per_turn,
    }


class CutLength:
    """How far the carriage was seen to travel in a cut: a witness beside the program's own report."""

    def __init__(self, plan: CutPlan, machine: MachineProfile) -> None:
        self._planned = plan.checked.highest[machine.carriage.motor]
        self._begin, self._per_mm = plan.carriage_start, machine.carriage.counts_per_mm
        self._per_turn = plan.setup.carriage_per_turn
        self._highest = float("-inf")

    def see(self, snapshot: Snapshot) -> None:
        """Process a poll of the cut."""
        self._highest = max(self._highest, snapshot.carriage.commanded_position)

    @property
    def turns(self) -> int:
        """The whole turns of feed that were observed."""
        return int(max(self._highest - self._begin, 0.0) / self._per_turn)

    @property
    def problem(self) -> Problem | None:
        """Report a cut shorter than planned; None if the whole length was cut."""
        if self._highest >= self._planned - LENGTH_MARGIN_MM * self._per_mm:
            return None
        cut, planned = (max(end - self._begin, 0.0) / self._per_mm for end in (self._highest, self._planned))
        return Problem(code="cut.length_short", key="carriage", value=f"{cut:.2f} mm", limit=f"{planned:.2f} mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramEnd:
    """How the program of a cut reports its end, read after it has stopped running.

    `turns` are those of the cut, `finished` whether it reached its last line, `end_asked` whether its flag was
    set, `stopped_by` the number of the console that reported stopping the machine, 0 none.
    """

    turns: float
    finished: bool
    end_asked: bool = False
    stopped_by: int = 0


def end_problems(plan: CutPlan, end: ProgramEnd, length: CutLength, *, held: bool) -> tuple[Problem, ...]:
    """Return why an ended cut is not the planned one, and who ended it where that is known.

    `held` is whether this console asked it to end early; then it only has to have ended properly.
    """
    planned = plan.setup.whole_turns
    short = end.turns != planned or length.problem is not None
    if end.finished and (held or not short):
        return ()
    if not end.finished and not end.stopped_by and length.problem is None:
        return (Problem(code="cut.disturbed"),)
    whole, clear = plan.setup.turns, plan.setup.turns_clear
    # Reports turns in the part, as shown during the cut; a program counts turns that have begun.
    value, limit = (f"{max(turns - clear, 0.0):.0f}" for turns in (min(end.turns, whole), whole))
    early = Problem(code="cut.ended_early", value=value, limit=limit)
    return (early, *_reason(end, length, held=held))


def _reason(end: ProgramEnd, length: CutLength, *, held: bool) -> Iterator[Problem]:
    if end.stopped_by:
        yield Problem(code="cut.stopped_by_console", value=str(end.stopped_by))
    elif not end.finished:
        yield Problem(code="cut.stopped_by_another")
    elif end.end_asked and not held:
        yield Problem(code="cut.held_by_another")
    elif length.problem is not None:
        yield length.problem
