"""The feed hold of a running cut: asked for and ended by the host, reported by the controller.

Nothing is assumed of it: the program is on its path until it reports otherwise, and back on it when it says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

from drivers.controller import Controller
from drivers.cutting.planning import CutPlan
from drivers.errors import ControllerError, LinkError, LinkTimeoutError, RefusedError
from drivers.lathe.commands import CommandPath
from drivers.lathe.polling import POLL_TIMEOUT_S
from drivers.lathe.snapshot import Snapshot
from drivers.link.base import is_gone
from drivers.pmac.programs.hold import HELD_SEGMENTS, HOLD, HOLD_STATE, MOST_HELD_S, SEGMENTS_A_TURN
from drivers.pmac.programs.setup import TURNS_CUT
from profiles.lobe.moving_out import out_ms
from profiles.machine import MachineProfile
from profiles.problem import Problem

__all__ = ["MOST_HELD_S", "NOT_HELD", "FeedHold", "HoldLedger", "HoldState"]

REPORT_TIMEOUT_S = 0.1  # less than what a poll may take: watchdog and polls come first
TURNS_BACK = 2.0
"""Turns after a hold that are not judged at least: the program reports its moves before they are made, and in the
first turn on uncut material the chip is not yet full, so that the tool is deflected less.
"""


def turns_back(plan: CutPlan, machine: MachineProfile) -> float:
    """Return the turns after a hold that are not judged: `TURNS_BACK`, and those of the taper.

    The tool left while the carriage ran on, and so cut less and less of the chip: from that place on, for as many
    turns as its way out took, it finds less than a full chip again.
    """
    tool, setup = machine.tool, plan.setup
    way_mm = (plan.checked.highest[tool.motor] - setup.retracted) * tool.count_um / 1000.0
    return TURNS_BACK + out_ms(way_mm) / 1000.0 * plan.spindle_speed_rpm / 60.0


class HoldState(IntEnum):
    """What the program reports."""

    CUTS = 0
    GOES_OUT = 1
    HELD = 2
    COMES_IN = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldReport:
    """What is known of the hold of a cut: whether it was `asked` for, its state, the turns taken off the feed.

    `cut_turns` are those that were cut before the hold, from the start of the feed.
    """

    asked: bool = False
    state: HoldState = HoldState.CUTS
    turns: int = 0
    cut_turns: float = 0.0

    @property
    def active(self) -> bool:
        """Whether a hold was asked for, or is under way."""
        return self.asked or self.state is not HoldState.CUTS


NOT_HELD = HoldReport()


class FeedHold:
    """The feed hold of one program. `report` is the last that is known; it is queried only around a hold."""

    def __init__(self, client: Controller, sending: CommandPath) -> None:
        self.report = NOT_HELD
        self._client, self._sending = client, sending

    def ask(self) -> None:
        """Ask for a hold at the end of the present turn. It moves the tool out alone, so it may be retried.

        Raises RefusedError: another console controls the machine. LinkError: the link broke.
        """
        self._sending.refuse_unless_owner()
        self.report = replace(self.report, asked=True)
        try:
            self._client.request(f"{HOLD}=1", POLL_TIMEOUT_S)
        except LinkTimeoutError:
            self._client.request(f"{HOLD}=1", POLL_TIMEOUT_S)

    def resume(self, *, one_turn: bool = False) -> None:
        """Bring the tool in again, with `one_turn` for a single turn. This moves the tool; it is sent once.

        Raises:
            StoppedError: somebody stopped the machine; nothing was sent.
            RefusedError: `cut.not_held`, the program does not report that it is held; and as for any motion.
            LinkError: the link broke. Where a reply is missing, the reports tell what became of it.
        """
        if self.report.state is not HoldState.HELD:
            raise RefusedError(Problem(code="cut.not_held"))
        try:
            self._sending.send_once(f"{HOLD}={2 if one_turn else 0}")
        except LinkTimeoutError:
            return
        self.report = replace(self.report, asked=one_turn)

    def read(self) -> None:
        """Query the state while a hold is active, between two polls; a missing reply is left to the next round.

        Raises LinkError: the link is gone.
        """
        if not self.report.active:
            return
        try:
            items = (HOLD, HOLD_STATE, HELD_SEGMENTS, SEGMENTS_A_TURN, TURNS_CUT)
            asked, state, segments, turn, cut_turns = self._client.numbers(*items, timeout_s=REPORT_TIMEOUT_S)
        except ControllerError:
            return
        except LinkError as error:
            if is_gone(error):
                raise
            return
        turns = round(segments / turn) if turn > 0.0 else 0
        self.report = HoldReport(asked=asked != 0.0, state=HoldState(int(state)), turns=turns, cut_turns=cut_turns)


class HoldLedger:
    """The polls of a cut as if it had not been held: none of a hold, and those after it by its turns earlier.

    So whatever judges a cut by its turns, its path and its time judges the same cut. `held_s` is how long it was
    held, `turns` the turns of the spindle in that time, which are whole.
    """

    def __init__(self, counts_per_turn: float, turns_back: float = TURNS_BACK) -> None:
        self.turns = 0
        self.held_s = 0.0
        self._per_turn, self._turns_back = counts_per_turn, turns_back
        self._before: Snapshot | None = None
        self._until: float | None = None
        self._shift_s = 0.0

    def see(self, snapshot: Snapshot, report: HoldReport) -> Snapshot | None:
        """Return a poll as it would have been without any hold; None if it does not belong to the cut."""
        before = self._before
        if report.active:
            self._until = snapshot.spindle.position + self._turns_back * self._per_turn
            return None
        if self._until is not None:
            if abs(snapshot.spindle.position) < abs(self._until):
                return None
            self._resume(snapshot, before, report)
        self._before, self._until = snapshot, None
        return self._shift_poll(snapshot)

    def _resume(self, snapshot: Snapshot, before: Snapshot | None, report: HoldReport) -> None:
        if before is not None:
            passed = (snapshot.spindle.position - before.spindle.position) / self._per_turn
            passed_s = snapshot.at_s - before.at_s
            taken_s = (report.turns - self.turns) * passed_s / passed if passed else 0.0
            self._shift_s += taken_s
            self.held_s += taken_s
        self.turns = report.turns

    def _shift_poll(self, snapshot: Snapshot) -> Snapshot:
        if not self.turns:
            return snapshot
        spindle = snapshot.spindle
        position = spindle.position - self.turns * self._per_turn
        return replace(
            snapshot,
            asked_s=snapshot.asked_s - self._shift_s,
            at_s=snapshot.at_s - self._shift_s,
            spindle=replace(spindle, position=position),
        )
