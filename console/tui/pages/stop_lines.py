"""What the page Run says after a stop, and while nothing is known of the machine, as lines of text."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import dropwhile

from console.session.progress import CutProgress, CutStage
from console.session.state import Activity, StationState, StopState
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, fact, wrapped
from console.tui.pages.cut_lines import NOTHING
from console.tui.theme import Token

LABEL_WIDTH = 13
LOOKED_S = 1.0
"""Time over which the speed of the spindle is told from its positions."""

TURNING_RPM = 1.0
"""Speed from which the spindle turns; a drive that is off may creep a count or two."""

RUNNING = frozenset({CutStage.RUN_UP, CutStage.CUT, CutStage.RETRACT})
"""Stages in which the program of a cut runs."""

Look = tuple[float, float]


def recent(looks: Sequence[Look], look: Look) -> tuple[Look, ...]:
    """Return the looks at the spindle (machine time in s, counts) of the last second, with a new one."""
    if looks and looks[-1][0] == look[0]:
        return tuple(looks)
    return (*dropwhile(lambda old: old[0] < look[0] - LOOKED_S, looks), look)


def turning_rpm(looks: Sequence[Look], counts_per_rev: float) -> float | None:
    """Return the mean speed between the first and the last look; None when there is only one."""
    if len(looks) < 2:
        return None
    (from_s, from_counts), (to_s, to_counts) = looks[0], looks[-1]
    return 60.0 * (to_counts - from_counts) / counts_per_rev / (to_s - from_s)


class CutOfStop:
    """Tells whether a stop came during the cut that is shown: the progress of a cut outlives its stop."""

    def __init__(self) -> None:
        self._over: CutProgress | None = None
        self._sent_s: float | None = None

    def see(self, state: StationState) -> None:
        """Remember with which stop, or without one, a cut was first seen to be over."""
        if state.cut is self._over or state.activity in (Activity.POSITIONING, Activity.CUTTING):
            return
        self._over = state.cut
        self._sent_s = None if state.stop is None else state.stop.sent_s

    def is_over(self, cut: CutProgress | None) -> bool:
        """Whether this is the progress of a cut that does not go on any more."""
        return cut is not None and cut is self._over

    def of(self, state: StationState) -> CutProgress | None:
        """Return the progress of the cut that this stop ended, None where it ended no cut."""
        cut, stop = state.cut, state.stop
        if cut is None or stop is None or cut.stage not in RUNNING:
            return None
        return cut if cut is self._over and stop.sent_s == self._sent_s else None


def stop_lines(text: Catalogue, stop: StopState, speed_rpm: float | None, width: int) -> list[Line]:
    """Return how a stop ended, and what to do, in order. `speed_rpm` is that of the spindle, None if not known."""

    def row(key: str, value: str, token: Token) -> Line:
        return fact(text(f"run_page.stop.{key}"), value, width, label_width=LABEL_WIDTH, token=token)

    how = text("run_page.stop.kill") if stop.killed else text("run_page.stop.ramp")
    rows = [*_not_delivered(text, stop, width), row("by", how, Token.TEXT)]
    if stop.rest_s is None:
        rows.append(row("rest", text("run_page.rest_unproven"), Token.WARNING))
    else:
        rows.append(row("rest", f"{stop.rest_s - stop.sent_s:.1f} s", Token.TEXT))
    if speed_rpm is not None and abs(speed_rpm) >= TURNING_RPM:
        rows.append(spindle_line(text, speed_rpm, width))
    if stop.rest_s is not None:
        drives = text("run_page.drives_closed") if stop.can_retract else text("run_page.drives_open")
        rows.append(row("tool", *_tool(text, stop)))
        rows.append(row("drives", drives, Token.TEXT if stop.can_retract else Token.WARNING))
    return [*rows, BLANK, *wrapped(_remedy(text, stop), width, Token.STRONG)]


def spindle_line(text: Catalogue, speed_rpm: float | None, width: int) -> Line:
    """Return whether the spindle turns, and how fast; a dash while that is not known."""
    label = text("run_page.stop.spindle")
    if speed_rpm is None:
        return fact(label, NOTHING, width, label_width=LABEL_WIDTH)
    if abs(speed_rpm) < TURNING_RPM:
        return fact(label, text("run_page.still"), width, label_width=LABEL_WIDTH)
    value = f"! {text('run_page.turns')} {speed_rpm:.0f} rpm"
    return fact(label, value, width, label_width=LABEL_WIDTH, token=Token.WARNING)


def lost_lines(text: Catalogue, state: StationState, now_s: float, width: int) -> list[Line]:
    """Return that nothing is known any more, since when, and what to do."""
    rows = [] if state.stop is None else _not_delivered(text, state.stop, width)
    if state.snapshot is None:
        return [*rows, *wrapped(text("run_page.lost.never"), width, Token.WARNING)]
    age = text("run_page.lost.age", age=f"{max(now_s - state.looked_s, 0.0):.0f}")
    remedy = text("run_page.lost.remedy")
    return [*rows, *wrapped(age, width, Token.WARNING), BLANK, *wrapped(remedy, width, Token.STRONG)]


def stale(lines: Sequence[Line]) -> list[Line]:
    """Return lines as values of the past."""
    return [tuple((piece, Token.STALE) for piece, _ in pieces) for pieces in lines]


def _not_delivered(text: Catalogue, stop: StopState, width: int) -> list[Line]:
    if stop.delivered:
        return []
    return [*wrapped(f"!!! {text('run_page.not_delivered')}", width, Token.ALARM), BLANK]


def _tool(text: Catalogue, stop: StopState) -> tuple[str, Token]:
    """Where the tool is. It may be clear now, but nothing keeps it there while the drives are off."""
    if stop.tool_in_part:
        return "! " + text("run_page.tool_in_part"), Token.WARNING
    if stop.tool_in_part is None:
        return "? " + text("run_page.tool_unknown"), Token.WARNING
    if not stop.can_retract:
        return "? " + text("run_page.tool_not_held"), Token.WARNING
    return text("run_page.tool_out"), Token.TEXT


def _remedy(text: Catalogue, stop: StopState) -> str:
    if stop.rest_s is None:
        return text("run_page.remedy.wait")
    if stop.tool_in_part is False:
        return text("run_page.remedy.clear") if stop.can_retract else text("run_page.remedy.not_held")
    return text("run_page.remedy.retract") if stop.can_retract else text("run_page.remedy.by_hand")
