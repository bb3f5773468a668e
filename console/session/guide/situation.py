"""The situation that the guide judges: the state of the machine and the open job, and the facts that follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto
from functools import cached_property

from console.session.cut.alignment import ENDED_EARLY, Alignment, AlignStep, step_now, table_problems
from console.session.cut.interlocks import Interlock
from console.session.guide.measured_part import in_scatter
from console.session.guide.start_checks import checks
from console.session.learning.learning_steps import LearningOutcome
from console.session.stages import without_half
from console.session.station.jogging import clears_tables, over_part, tool_in_part
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from console.session.work import Work
from drivers.cutting.feed_hold import HoldState
from drivers.cutting.strategy import Strategy
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.machine import MachineProfile

ENDED = (CutStage.DONE, CutStage.HELD)
LEFT_STAGES = frozenset({CutStage.CUT, CutStage.PAUSED, CutStage.RETRACT})
"""Stages with the tool in the part, or retracting; a cut that ended in one of them was interrupted."""

NEAR_MARK_DEG = 1.0  # distance from the mark beyond which jaw 1 was not turned to it


class GuidePhase(Enum):
    """Phases of a cut."""

    BEFORE = auto()
    CUTTING = auto()
    ENDED = auto()
    STOPPED = auto()
    LOST = auto()


def phase_of(state: StationState) -> GuidePhase:
    """Return the phase in this state."""
    if state.activity is Activity.LOST:
        return GuidePhase.LOST
    if state.stop is not None:
        return GuidePhase.STOPPED
    if state.cut is None or state.armed is not None:
        return GuidePhase.BEFORE
    if state.cut.stage in ENDED:
        return GuidePhase.ENDED
    return GuidePhase.CUTTING if state.activity in (Activity.POSITIONING, Activity.CUTTING) else GuidePhase.BEFORE


def angle_deg(snapshot: Snapshot, machine: MachineProfile) -> float:
    """Return the spindle angle from its index, in [0, 360) when written with two decimals."""
    turns = snapshot.spindle.position / machine.spindle.counts_per_rev
    return round(360.0 * (turns - math.floor(turns)), 2) % 360.0


def jaw_off_deg(state: StationState, machine: MachineProfile) -> float | None:
    """Return how far (deg, 0 or more) from the mark jaw 1 was taken; None if the simulator does not show it."""
    jaw, seen, snapshot = state.alignment.jaw, state.seen, state.snapshot
    if jaw is None or seen is None or seen.dials is not None or snapshot is None:
        return None
    if state.activity is Activity.LOST:
        return None
    if "desired_velocity_zero" not in snapshot.spindle.flags:
        return None
    off_deg = angle_deg(snapshot, machine) - seen.jaw_1_past_mark_deg - jaw.angle_deg
    return abs((off_deg + 180.0) % 360.0 - 180.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Situation:
    """One moment. `now_s` is machine time."""

    state: StationState
    work: Work | None
    machine: MachineProfile
    now_s: float = 0.0

    @property
    def job(self) -> Job | None:
        """The open job, None without one."""
        return None if self.work is None else self.work.job

    @property
    def alignment(self) -> Alignment:
        """What is known of the set-up."""
        return self.state.alignment

    @cached_property
    def step(self) -> AlignStep | None:
        """The present step of the alignment; None if all are done."""
        return step_now(self.alignment, self.job)

    @property
    def loops_closed(self) -> bool:
        """Whether every loop is known to be closed."""
        return self.state.snapshot is not None and self.state.snapshot.loops_closed

    @property
    def drives_on(self) -> bool:
        """Whether a loop is closed, or may be: while nothing is known, hands stay out."""
        return self.state.snapshot is None or not self.state.snapshot.loops_open

    @property
    def ended_early(self) -> bool:
        """Whether the last cut ended early, and no clamping was confirmed since."""
        return self.alignment.clamping is None and any(each.code == ENDED_EARLY for each in self.alignment.lost)

    @property
    def homes_first(self) -> bool:
        """Whether the home search is what takes the tool out of a part that a cut may have left it in.

        The drives hold the tool, and without a home nobody knows where. The search moves it first, and outward.
        """
        return self.ended_early and self.loops_closed and not self.alignment.homed

    @property
    def at_home(self) -> bool:
        """Whether the drives hold the tool at its home, where it is clear of every part, or further out."""
        snapshot = self.state.snapshot
        if snapshot is None or not snapshot.loops_closed or "home_complete" not in snapshot.tool.flags:
            return False
        return snapshot.tool.position <= settings_of(self.machine, AxisName.TOOL).in_position_counts

    @property
    def left_in_part(self) -> bool:
        """Whether a cut that was interrupted may have left the tool in the part."""
        cut, clamped = self.state.cut, self.alignment.clamping is not None
        left = cut is not None and cut.stage in LEFT_STAGES and clamped
        return (left or self.ended_early) and not self.at_home

    @cached_property
    def in_part(self) -> bool | None:
        """Whether the tool is in or at the clamped part, whatever job is open; None if that is not known."""
        if self.state.snapshot is None:
            return None
        return tool_in_part(self.state.snapshot, self.machine, self.alignment)

    @property
    def over_part(self) -> bool:
        """Whether the clamped part is in front of the tool, by the rule with which the station refuses."""
        clamping, snapshot = self.alignment.clamping, self.state.snapshot
        if clamping is None or snapshot is None:
            return False
        return over_part(snapshot, self.machine, clamping.overhang_mm)

    @property
    def touches(self) -> bool:
        """Whether the tool touches the part, as a simulated lathe shows it."""
        seen = self.state.seen
        if seen is None:
            return False
        heard = seen.dials is not None and seen.dials.contact
        return heard or (seen.tool_gap_mm is not None and seen.tool_gap_mm <= 0.0)

    @property
    def jaw_off(self) -> bool:
        """Whether jaw 1 was visibly taken elsewhere than at the mark."""
        return (jaw_off_deg(self.state, self.machine) or 0.0) > NEAR_MARK_DEG

    @property
    def tables_on(self) -> bool:
        """Whether a cut has left a table on."""
        return bool(self.alignment.tables)

    @property
    def clears_tables(self) -> bool:
        """Whether F8 clears what a table adds, in place of a retract."""
        return clears_tables(self.state.snapshot, self.alignment)

    @property
    def kills_tables(self) -> bool:
        """Whether the drives are to be disabled first: a table adds something, and no home is known."""
        return table_problems(self.alignment) != self.alignment.tables

    @property
    def must_come_out(self) -> bool:
        """Whether the chuck stays shut until the tool is out: it is in the part, or a table is on."""
        return self.tables_on or self.in_part is True

    @cached_property
    def checks(self) -> tuple[Interlock, ...]:
        """Every interlock of the start, in the order in which to fix them."""
        return checks(self.state, self.work, self.machine)

    @cached_property
    def first_failed(self) -> str:
        """The name of the first interlock that does not hold; empty if all hold."""
        return next((check.name for check in self.checks if check.problems), "")

    @property
    def feed_hold(self) -> HoldState | None:
        """The state of a feed hold in the cut; None without one."""
        cut = self.state.cut
        return cut.hold.state if cut is not None and cut.stage is CutStage.CUT and cut.hold.active else None

    @property
    def has_half(self) -> bool:
        """Whether the strategy of the next cut has a half of its compensation, as far as that is known."""
        return self.work is None or not without_half(Strategy(self.work.strategy))

    @property
    def learning_result(self) -> LearningOutcome | None:
        """What the measured part teaches; None where there are reasons against it."""
        part = self.state.measured
        learning = None if part is None else part.learning
        return None if learning is None or learning.reasons else learning.taught

    @property
    def not_taught(self) -> frozenset[str]:
        """The codes of the reasons why nothing is learned of the measured part."""
        part = self.state.measured
        learning = None if part is None else part.learning
        return frozenset(() if learning is None else (reason.code for reason in learning.reasons))

    @property
    def stands_out(self) -> bool:
        """Whether more is left than the scatter of clampings, which alone is no reason to stay for a part."""
        return self.learning_result is not None and not in_scatter(self.learning_result)
