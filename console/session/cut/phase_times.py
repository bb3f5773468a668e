"""The phases of a cut with the time that each still takes, and how far its axes have to go."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from drivers.cutting.planning import CutPlan
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, Snapshot, driven_axes
from profiles.machine import MachineProfile

ARRIVED_COUNTS = 20.0  # an axis this near to its target has arrived
AXIS_S = 0.4  # ramps and settling of one jog, beside its way at jog speed


class CutPhase(StrEnum):
    """The phases from F6 to rest: the axes go to the start, the spindle runs up, and so on.

    `index` is the wait for the index of a spindle that is the clock of the program; `home` runs the spindle down
    and takes the carriage back where the program does so.
    """

    APPROACH = "approach"
    RUN_UP = "run_up"
    INDEX = "index"
    CUT = "cut"
    RETRACT = "retract"
    HOME = "home"


@dataclass(frozen=True, slots=True)
class PhaseLeft:
    """A phase that is not over, and the seconds that it still takes."""

    phase: CutPhase
    left_s: float


@dataclass(frozen=True, slots=True)
class AxisToGo:
    """The way that an axis still has to go: mm, for the spindle degrees."""

    axis: AxisName
    left: float


def planned_phases(plan: CutPlan, machine: MachineProfile) -> tuple[PhaseLeft, ...]:
    """Return every phase of the program of a cut with its planned time; the approach is not in the program."""
    setup, checked = plan.setup, plan.checked
    carriage, tool = (checked.motors.index(motor) for motor in (machine.carriage.motor, machine.tool.motor))
    turn_s = 60.0 / plan.spindle_speed_rpm
    cut_s = (setup.whole_turns - setup.turns_clear) * turn_s
    now_s, begun_s, out_s = 0.0, None, None
    for move in checked.moves:
        now_s += sum(piece.duration_ms for piece in move.pieces) / 1000.0
        at = move.record.target
        if begun_s is None and at[carriage] >= setup.carriage_face:
            begun_s = now_s
        if begun_s is not None and out_s is None and now_s > begun_s + cut_s - turn_s:
            out_s = now_s if at[tool] <= setup.retracted + ARRIVED_COUNTS else None
    begun_s = 0.0 if begun_s is None else begun_s
    out_s = begun_s + cut_s if out_s is None else out_s
    index = (PhaseLeft(CutPhase.INDEX, turn_s),) if plan.strategy.traits.spindle_time else ()
    return (
        PhaseLeft(CutPhase.RUN_UP, begun_s),
        *index,
        PhaseLeft(CutPhase.CUT, cut_s),
        PhaseLeft(CutPhase.RETRACT, max(out_s - begun_s - cut_s, 0.0)),
        PhaseLeft(CutPhase.HOME, max(plan.duration_s - out_s, 0.0)),
    )


def to_the_start(plan: CutPlan, machine: MachineProfile, snapshot: Snapshot) -> tuple[AxisToGo, ...]:
    """Return how far each axis still is from where the program begins; those that have arrived are left out."""
    targets = {
        AxisName.CARRIAGE: plan.carriage_start,
        AxisName.SPINDLE: plan.spindle_start,
        AxisName.TOOL: plan.tool_start,
    }
    per_unit = {
        AxisName.CARRIAGE: machine.carriage.counts_per_mm,
        AxisName.SPINDLE: machine.spindle.counts_per_rev / 360.0,
        AxisName.TOOL: machine.tool.counts_per_mm,
    }
    return tuple(
        AxisToGo(axis, abs(counts) / per_unit[axis])
        for axis in targets
        if axis in driven_axes(machine)
        and abs(counts := targets[axis] - snapshot.axis(axis).position) > ARRIVED_COUNTS
    )


def approach_s(plan: CutPlan, machine: MachineProfile, snapshot: Snapshot) -> float:
    """Return about how long the axes still take to where the program begins, one after the other, s."""
    ways = to_the_start(plan, machine, snapshot)
    return sum(way.left / settings_of(machine, way.axis).jog_speed + AXIS_S for way in ways)


class PhaseClock:
    """Which phases of one cut are not over, with the time left: by the clock of the polls, the cut by its Z."""

    def __init__(self, plan: CutPlan, machine: MachineProfile) -> None:
        self._plan, self._machine = plan, machine
        self._planned = planned_phases(plan, machine)
        self._begun_s: dict[CutPhase, float] = {}

    def left(
        self, phase: CutPhase, snapshot: Snapshot, cut_left_s: float, pace: float = 1.0
    ) -> tuple[PhaseLeft, ...]:
        """Return what is left from `phase` on; `cut_left_s` is that of the cut by the length already cut.

        In a second `pace` of the program's time passes.
        """
        if phase is CutPhase.APPROACH:
            first = PhaseLeft(phase, approach_s(self._plan, self._machine, snapshot))
            return first, *self._planned
        order = [each.phase for each in self._planned]
        begun_s = self._begun_s.setdefault(phase, snapshot.at_s)
        left: list[PhaseLeft] = []
        gone_s = snapshot.at_s - begun_s
        for each in self._planned[order.index(phase) :]:
            if each.phase is CutPhase.CUT:  # its time is that of its length
                left.append(PhaseLeft(each.phase, cut_left_s if phase is CutPhase.CUT else each.left_s))
                gone_s = 0.0
                continue
            # What a phase has taken beyond its time is taken from the next one.
            takes_s = each.left_s / pace
            spent_s = min(gone_s, takes_s)
            gone_s -= spent_s
            if takes_s > spent_s or each.phase is phase:
                left.append(PhaseLeft(each.phase, takes_s - spent_s))
        return tuple(left)
