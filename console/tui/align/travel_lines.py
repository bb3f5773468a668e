"""Where each axis is between its limits, and which key jogs it which way; how fast, and for how long."""

from __future__ import annotations

from rich.cells import cell_len

from console.session.station.jogging import Steps, setup_speed, speed_problem, step_speed
from console.session.station.state import StationState
from console.session.station.targets import travel_of
from console.text.catalogue import Catalogue
from console.tui.lines import NOTHING, Line, Piece, dim, fit_text, line, to_the_right
from console.tui.theme import Token
from drivers.lathe.snapshot import AxisName
from profiles.machine import MachineProfile

LONGEST_BAR = 40
NEAR_LIMIT_MM = 1.0
_LIMIT_WIDTH = 14


def travel_lines(text: Catalogue, state: StationState, machine: MachineProfile, width: int) -> list[Line]:
    """Return a bar for the tool and one for the carriage, with their keys at the ends, and the nearer limit."""
    ends = {
        AxisName.TOOL: ("↑", "away_short", "toward_short", "↓"),
        AxisName.CARRIAGE: ("←", "chuck", "tailstock", "→"),
    }
    words = {
        axis: (text(f"align_page.{low}"), text(f"align_page.{high}")) for axis, (_, low, high, _) in ends.items()
    }
    left, right = (max(cell_len(pair[side]) for pair in words.values()) for side in (0, 1))
    cells = min(width - left - right - 8 - _LIMIT_WIDTH, LONGEST_BAR)
    rows = []
    for axis, (before, _, _, after) in ends.items():
        low, high = words[axis]
        head: Line = ((before, Token.KEY), dim(" " + fit_text(low, left) + " "))
        tail: Line = (dim(" " + high + " "), (after, Token.KEY), dim(" " * (right - cell_len(high))))
        rows.append((*head, *_bar(state, machine, axis, cells), *tail, _limit(text, state, machine, axis)))
    return rows


def _bar(state: StationState, machine: MachineProfile, axis: AxisName, cells: int) -> Line:
    """Return the way between the soft limits; the chuck, towards which Z is positive, is on the left."""
    if cells < 1:
        return ()
    fraction = None
    if state.snapshot is not None and "home_complete" in state.snapshot.axis(axis).flags:
        fraction = travel_of(state.snapshot, machine, axis).fraction
    if fraction is None:
        return (dim("├" + "─" * cells + "┤"),)
    at = min(int((1.0 - fraction if axis is AxisName.CARRIAGE else fraction) * cells), cells - 1)
    return (dim("├" + "─" * at), ("●", Token.STRONG), dim("─" * (cells - at - 1) + "┤"))


def _limit(text: Catalogue, state: StationState, machine: MachineProfile, axis: AxisName) -> Piece:
    if state.snapshot is None or "home_complete" not in state.snapshot.axis(axis).flags:
        return dim(to_the_right(NOTHING, _LIMIT_WIDTH))
    to_limit_mm = travel_of(state.snapshot, machine, axis).to_limit_mm
    if to_limit_mm is None:
        return dim(to_the_right(text("align_page.no_limit"), _LIMIT_WIDTH))
    words = to_the_right(text("align_page.to_limit", way=text.units.show(to_limit_mm, "mm", 1)), _LIMIT_WIDTH)
    return (words, Token.WARNING) if to_limit_mm < NEAR_LIMIT_MM else dim(words)


def speed_line(text: Catalogue, machine: MachineProfile, steps: Steps) -> Line:
    """Return the highest speed of the selected steps, and what set-up allows; a faster one is refused."""
    speeds = {axis: _figure(step_speed(machine, axis, steps.step_length(axis))) for axis in AxisName}
    words = text(
        "align_page.speeds",
        tool=speeds[AxisName.TOOL],
        carriage=speeds[AxisName.CARRIAGE],
        spindle=speeds[AxisName.SPINDLE],
        linear=_figure(setup_speed(AxisName.TOOL)),
        turning=_figure(setup_speed(AxisName.SPINDLE)),
    )
    refused = any(speed_problem(machine, axis, steps.step_length(axis)) is not None for axis in AxisName)
    return line(("! " + words, Token.WARNING)) if refused else line(dim(words))


def _figure(speed: float) -> str:
    """Return a speed in at most four cells."""
    return f"{speed:.2f}" if speed < 1.0 else f"{speed:.1f}" if speed < 99.95 else f"{speed:.0f}"


def time_left_s(state: StationState, now_s: float) -> float | None:
    """Return how long the present motion still takes, s; None where that is not known, or nothing moves."""
    if state.ends_s is None or not state.moving or state.stop is not None:
        return None
    return max(state.ends_s - now_s, 0.0)


def moving_words(text: Catalogue, state: StationState, now_s: float) -> str:
    """Return that something moves: which axis is homed, and how long it takes, as far as that is known."""
    words, snapshot = text("align_page.moving"), state.snapshot
    homing = [] if snapshot is None else [name for name in AxisName if "home_search" in snapshot.axis(name).flags]
    if homing:
        words = text("align_page.homing", axis=text(f"align_page.letter.{homing[0]}"))
    left_s = time_left_s(state, now_s)
    if left_s is None:
        return words
    known = "align_page.moving_at_most" if state.ends_at_most else "align_page.moving_left"
    return text(known, what=words, left=f"{left_s:.0f} s")
