"""Phase of the page Run, and the word for what comes next."""

from __future__ import annotations

from enum import Enum, auto

from console.session.cut.alignment import table_problems
from console.session.stages import Stage, without_half
from console.session.station.commands import ClearTables, Command, Retract
from console.session.station.jogging import clears_tables, tool_in_part
from console.session.station.progress import CutProgress, CutStage
from console.session.station.state import Activity, StationState
from console.tui.align.left_part import ended_early, stands_at_home
from console.tui.pages.run_lines import checks, is_over
from console.tui.theme import Token
from console.tui.ui_context import View
from drivers.cutting.feed_hold import HoldState
from drivers.cutting.strategy import Strategy
from profiles.machine import MachineProfile

ENDED = (CutStage.DONE, CutStage.HELD)
LEFT_STAGES = frozenset({CutStage.CUT, CutStage.PAUSED, CutStage.RETRACT})
"""Stages with the tool in the part, or retracting; a cut that ended in one of them was interrupted."""


class Phase(Enum):
    """Phases of the page."""

    BEFORE = auto()
    CUTTING = auto()
    ENDED = auto()
    STOPPED = auto()
    LOST = auto()


def phase_of(state: StationState) -> Phase:
    """Return the phase of the page in this state."""
    if state.activity is Activity.LOST:
        return Phase.LOST
    if state.stop is not None:
        return Phase.STOPPED
    if state.cut is None or state.armed is not None:
        return Phase.BEFORE
    if state.cut.stage in ENDED:
        return Phase.ENDED
    return Phase.CUTTING if state.activity in (Activity.POSITIONING, Activity.CUTTING) else Phase.BEFORE


def next_word(view: View, machine: MachineProfile) -> tuple[str, Token]:  # noqa: C901 - one branch a case
    """Return the word of the sentence for what comes next, and how it is shown."""
    state = view.state
    phase = phase_of(state)
    if phase is Phase.STOPPED:
        proven = state.stop is not None and state.stop.rest_s is not None
        return "stopped" if proven else "stopping", Token.ACTION
    if phase is Phase.CUTTING and state.cut is not None:
        return _stage_word(state.cut), Token.STRONG
    if state.armed is not None:
        return "armed", Token.ACTION
    if state.loading_until_s is not None:
        return "loading", Token.DIM
    if state.activity is Activity.RETRACTING:
        return "taken_out", Token.STRONG
    if state.activity is not Activity.READY:
        return "moves" if state.moving else "wait", Token.DIM
    if phase is Phase.ENDED and is_over(state):
        word = "measured" if not state.cut_done else "measure" if state.simulated else "take_out"
        return word, Token.ACTION
    if state.alignment.tables:
        closed = state.snapshot is not None and state.snapshot.loops_closed
        if clears_tables(state.snapshot, state.alignment):
            return "table_clear", Token.ACTION
        if table_problems(state.alignment) != state.alignment.tables:
            return "table_kill", Token.ACTION
        return ("table_off" if closed else "switch_on"), Token.ACTION
    left = state.cut is not None and state.cut.stage in LEFT_STAGES and state.alignment.clamping is not None
    left = (left or ended_early(state)) and not stands_at_home(state.snapshot, machine)
    if left and not state.alignment.homed:
        closed = state.snapshot is not None and state.snapshot.loops_closed
        return "home_out" if closed else "home_out_off", Token.ACTION
    if left and (inside := in_part(state, machine)) is not False:
        closed = state.snapshot is not None and state.snapshot.loops_closed
        held = "retract" if inside else "retract_unknown"
        return (held if closed else "switch_on"), Token.ACTION
    return _missing_word(view, machine), Token.ACTION


def way_out(state: StationState) -> Command:
    """Return what F8 does: retract the tool, or without a home clear what a table adds to it."""
    return ClearTables() if clears_tables(state.snapshot, state.alignment) else Retract()


def in_part(state: StationState, machine: MachineProfile) -> bool | None:
    """Whether the tool is in or at the clamped part, None where that is not known."""
    if state.snapshot is None:
        return None
    return tool_in_part(state.snapshot, machine, state.alignment)


def _missing_word(view: View, machine: MachineProfile) -> str:
    if view.work is None:
        return "no_job"
    failed = [check.name for check in checks(view.state, view.work, machine) if check.problems]
    if not failed:
        cut = view.state.cut
        if view.state.touched is not None:
            return "arm_again"
        done_in_air = cut is not None and cut.in_air and cut.stage is CutStage.DONE
        if done_in_air and view.work.stage == Stage.AIR:
            return f"arm_air{without_half(Strategy(view.work.strategy))}"
        return "arm"
    return {"job": "set_up", "learned": "choose", "commissioned": "commission"}.get(failed[0], "align")


def _stage_word(cut: CutProgress) -> str:
    match cut.stage:
        case CutStage.POSITION:
            return "positioning"
        case CutStage.RETRACT:
            return "retracting"
        case _ if cut.holding:
            return "holding"
        case CutStage.PAUSED:
            return "paused"
        case CutStage.CUT if cut.hold.active:
            return "returning" if cut.hold.state is HoldState.COMES_IN else "hold_asked"
        case CutStage.RUN_UP:
            return "run_up"
        case _:
            return "cutting"
