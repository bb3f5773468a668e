"""Text of the jog panel of the page Align: step ladder, directions, stopping distance, visible state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.cells import cell_len

from console.session.station.jogging import STEPS_DEG, STEPS_MM, Steps, stopping_distance
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, Piece, clipped, dim, line, ranged, to_the_right, wrapped
from console.tui.theme import Token
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.machine import MachineProfile

_RUNG_WIDTH = 7

_SEEN_TO_DEG = 0.01
"""Rounding of the visible angle of jaw 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JogView:
    """Input of the panel. `left_s` is None while jogging is not enabled.

    + and - change the step of `axis`. `made` is how many steps the last presses have made.
    """

    machine: MachineProfile
    steps: Steps
    axis: AxisName
    made: int
    left_s: float | None
    moving: bool
    longest_mm: float
    simulated: bool
    seen: WorkshopView | None


def jog_lines(text: Catalogue, jog: JogView, width: int, height: int) -> list[Line]:
    """Return the jog panel; in little room the picture goes first, then the stopping distance."""
    must = [_enable_line(text, jog, width), *_ladder(text, jog)]
    seen = seen_lines(text, jog, width)
    picture, stopping_distance = _directions(text, jog), [_overrun_line(text, jog)]
    if len(must) + len(seen) + len(picture) + len(stopping_distance) <= height:
        spare = height - len(must) - len(seen) - len(picture) - len(stopping_distance)
        gaps = [[BLANK] if spare > n else [] for n in range(2)]
        return [*must, *gaps[0], *picture, *gaps[1], *stopping_distance, *seen]
    if len(must) + len(seen) + len(stopping_distance) <= height:
        return [*must, *stopping_distance, *seen]
    return clipped([*must, *seen], height, text("panel.more"))


def _enable_line(text: Catalogue, jog: JogView, width: int) -> Line:
    moving = line(" ", (text("align_page.moving"), Token.STRONG)) if jog.moving else _made(text, jog.made)
    if jog.left_s is None:
        return ranged((dim("○ " + text("align_page.jog_off")),), moving, width)
    left = text("align_page.jog_on", left=f"{math.ceil(jog.left_s)} s")
    return ranged((("● " + left, Token.STRONG),), moving, width)


def _made(text: Catalogue, made: int) -> Line:
    return line(" ", ("✓ ", Token.OK), text("align_page.made", count=made)) if made else BLANK


def _ladder(text: Catalogue, jog: JogView) -> list[Line]:
    linear = [f"{step:.3f}" for step in STEPS_MM]
    turning = [f"{step:.2f}" for step in STEPS_DEG]
    turns = jog.axis is AxisName.SPINDLE
    return [
        _rungs(linear, jog.steps.mm, " mm", changes=not turns),
        _rungs(turning, jog.steps.deg, " °", changes=turns),
    ]


def _rungs(steps: Sequence[str], chosen: int, unit: str, *, changes: bool) -> Line:
    """Return one ladder; a mark precedes the one that + and - change."""
    pieces: list[Piece] = [("▸" if changes else " ", Token.KEY)]
    for rung, step in enumerate(steps):
        width = _RUNG_WIDTH - (1 if rung == 0 else 0)  # the mark takes the first cell
        if rung == chosen:
            pieces.append((to_the_right(f"[{step}]", width + 1), Token.STRONG))
        else:
            pieces.append(dim(to_the_right(step, width) + " "))
    return (*pieces, dim(unit))


def _directions(text: Catalogue, jog: JogView) -> list[Line]:
    chuck = text("align_page.chuck")
    lead = " " * (cell_len(chuck) + 4)
    longest = text("align_page.at_most", step=f"{jog.longest_mm:.3f} mm")
    return [
        line(lead, ("↑ ", Token.KEY), text("align_page.away")),
        line(
            (f"{chuck} ", Token.TEXT),
            ("←", Token.KEY),
            dim(" ─┼─ "),
            ("→ ", Token.KEY),
            text("align_page.tailstock"),
            "   ",
            ("PgUp ", Token.KEY),
            text("align_page.forward"),
        ),
        line(lead, ("↓ ", Token.KEY), text("align_page.toward"), dim(" " + longest)),
    ]


def _overrun_line(text: Catalogue, jog: JogView) -> Line:
    tool, carriage, spindle = (
        _rounded_up(stopping_distance(jog.machine, axis, jog.steps.of(axis)), decimals)
        for axis, decimals in ((AxisName.TOOL, 3), (AxisName.CARRIAGE, 3), (AxisName.SPINDLE, 2))
    )
    return (dim(text("align_page.overrun", tool=tool, carriage=carriage, spindle=spindle)),)


def _rounded_up(value: float, decimals: int) -> str:
    """Format an upper bound, rounded up."""
    if not math.isfinite(value):
        return "∞"
    return f"{math.ceil(value * 10**decimals - 1e-6) / 10**decimals:.{decimals}f}"


def seen_lines(text: Catalogue, jog: JogView, width: int) -> list[Line]:
    """Return what is visible on the simulated lathe; on a real one, how to find it out."""
    if not jog.simulated:
        return wrapped(text("align_page.real"), width)
    seen = jog.seen
    mark: Piece = ("SIM", Token.SIM)
    if seen is None:
        return [line(mark, dim(" " + text("align_page.not_seen"))), BLANK]
    return [line(mark, " " + jaw_words(text, seen, jog.machine)), line(mark, " " + gap_words(text, seen))]


def jaw_words(text: Catalogue, seen: WorkshopView, machine: MachineProfile) -> str:
    """Return the angle of jaw 1 from the mark; within half a count, the spindle's resolution, it is there."""
    past = seen.jaw_1_past_mark_deg
    if abs(past) < 180.0 / machine.spindle.counts_per_rev + _SEEN_TO_DEG / 2.0:
        return text("align_page.at_mark")
    if past > 0:
        return text("align_page.past_mark", angle=f"{past:.2f}°")
    return text("align_page.before_mark", angle=f"{-past:.2f}°")


def gap_words(text: Catalogue, seen: WorkshopView) -> str:
    """Return the distance of the tool tip from the part."""
    gap = seen.tool_gap_mm
    if gap is None:
        return text("align_page.tool_beside")
    if gap > 0:
        return text("align_page.gap", gap=f"{gap:.3f} mm")
    return text("align_page.touches", depth=f"{abs(gap):.3f} mm")
