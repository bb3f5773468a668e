"""Jog panel of the page Align: step ladder, directions, stopping distance, visible state; picture of the chuck."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from operator import itemgetter

import numpy as np

from console.session.station.jogging import STEPS_DEG, STEPS_MM, Steps, longest_toward_mm, stopping_distance
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.align.hold_run import Overrun
from console.tui.align.travel_lines import moving_words, speed_line, travel_lines
from console.tui.lines import (
    BLANK,
    Line,
    Piece,
    dim,
    first_fitting,
    justify_line,
    line,
    to_the_right,
    width_of,
    wrap_line,
)
from console.tui.plot.canvas import BrailleCanvas
from console.tui.plot.cell_view import Cells
from console.tui.theme import Token
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.workshop_view import Dials, WorkshopView
from profiles.machine import MachineProfile

_RUNG_WIDTH = 7
_SEEN_TO_DEG = 0.01  # rounding of the visible angle of jaw 1
LEAST_ROWS, LEAST_COLUMNS = 4, 9

_RIM, _JAW, _JAW_1 = 0, 1, 2
_JAW_FRACTION = 0.5  # fraction of the radius to which a jaw reaches from the rim
_BESIDE = 3  # columns to the right of the rim, for the mark
CELLS = 13  # of the indicator dial: from its one end to the other, 0 in the middle
RANGE_UM = 500.0
_SIM: Piece = ("SIM ", Token.SIM)


@dataclass(frozen=True, slots=True, kw_only=True)
class JogView:
    """Input of the panel. `left_s` is None while disabled; `axis` has the step of + and -.

    `made` of `asked` steps of the last key are done. `now_s` is machine time,
    `overrun` how far a held key may go on after its release (mm or degrees), None for single steps alone.
    """

    machine: MachineProfile
    state: StationState
    steps: Steps
    axis: AxisName
    made: int
    asked: int
    now_s: float
    overrun: Overrun | None = None
    left_s: float | None


def jog_title(text: Catalogue, jog: JogView) -> str:
    """Return the title: what a held key does here, and how far the axis may go on behind it."""
    spindle, over = jog.axis is AxisName.SPINDLE, jog.overrun
    axes, unit = ("C °", "°") if spindle else ("X Z mm", " mm")
    if over is None:
        return text("align_page.jog", axes=axes)
    if over.released is None:
        return text("align_page.jog_hold", axes=axes, over=f"{over.silent:.3g}{unit}")
    silent = f"{over.silent:.3g}{unit}"
    return text("align_page.jog_release", over=f"{over.released:.3g}", silent=silent)


def jog_lines(text: Catalogue, jog: JogView, width: int, height: int | None) -> list[Line]:
    """Return the jog panel, all of it without a height; which key moves which way goes last.

    In little room the speeds and the stopping distance go first, then what is seen, then the ladders: a step of
    another length is refused or undone, one in the wrong direction may meet the part.
    """
    head = [_enable_line(text, jog, width), *_ladder(text, jog)]
    travel = [*travel_lines(text, jog.state, jog.machine, width), _turning_line(text, jog)]
    facts = [_stopping_line(text, jog), speed_line(text, jog.machine, jog.steps)]
    seen = seen_lines(text, jog, width)
    one = _of_step(seen, jog.state)
    ladder = head[1 + (jog.axis is AxisName.SPINDLE)]
    return first_fitting(
        height,
        text("panel.more"),
        [*head, BLANK, *travel, BLANK, *facts, *seen],
        [*head, BLANK, *travel, *facts, *seen],
        [*head, *travel, *facts, *seen],
        [*head, *travel, *facts, *one],
        [*head, *travel, facts[0], *seen],
        [*head, *travel, facts[0], *one],
        [*head, *travel, *one],
        [*head, *travel, facts[0]],
        [*head, *travel],
        [head[0], ladder, *travel],
        [head[0], *travel],
        travel[: max(height or 0, 0)],
    )


def jog_panel(text: Catalogue, jog: JogView, width: int, height: int) -> tuple[list[Line], str]:
    """Return the rows of the panel, and its mark where it lacks some of them: how to see those."""
    rows, every = (jog_lines(text, jog, width, room) for room in (height, None))
    return rows, "" if all(row in rows for row in every if row) else text("panel.more")


def _enable_line(text: Catalogue, jog: JogView, width: int) -> Line:
    right, under_way = BLANK, jog.made < jog.asked
    if under_way and jog.asked > 1:
        right = line(" ", (text("align_page.steps_of", made=jog.made, asked=jog.asked), Token.STRONG))
    elif jog.state.moving or under_way:
        right = line(" ", (moving_words(text, jog.state, jog.now_s), Token.STRONG))
    elif jog.made:
        right = line(" ", ("✓ ", Token.OK), text("align_page.made", count=jog.made))
    left = dim("○ " + text("align_page.jog_off"))
    if jog.left_s is not None:
        on = text("align_page.jog_on", left=f"{math.ceil(jog.left_s)} s")
        if width_of((*line("● " + on), *right)) > width:  # its time begins anew when the motion ends
            on = text("align_page.jog_moving")
        left = "● " + on, Token.STRONG
    return justify_line((left,), right, width)


def _ladder(text: Catalogue, jog: JogView) -> list[Line]:
    linear, turning = [f"{step:.3f}" for step in STEPS_MM], [f"{step:.2f}" for step in STEPS_DEG]
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


def _turning_line(text: Catalogue, jog: JogView) -> Line:
    """Return the keys of the spindle, and how long a step of the tool toward the work may be."""
    longest_mm = longest_toward_mm(jog.state.snapshot, jog.machine, jog.state.alignment)
    longest = text("align_page.at_most", step=f"{longest_mm:.3f} mm")
    return line(("PgUp ", Token.KEY), text("align_page.forward"), dim("   "), ("↓ ", Token.KEY), dim(longest))


def _stopping_line(text: Catalogue, jog: JogView) -> Line:
    tool, carriage, spindle = (
        _rounded_up(stopping_distance(jog.machine, axis, jog.steps.step_length(axis)), decimals)
        for axis, decimals in ((AxisName.TOOL, 3), (AxisName.CARRIAGE, 3), (AxisName.SPINDLE, 2))
    )
    return (dim(text("align_page.overrun", tool=tool, carriage=carriage, spindle=spindle)),)


def _rounded_up(value: float, decimals: int) -> str:
    if not math.isfinite(value):
        return "∞"
    return f"{math.ceil(value * 10**decimals - 1e-6) / 10**decimals:.{decimals}f}"


def dial_line(text: Catalogue, dials: Dials) -> Line:
    """Return the indicator at the mark, drawn, with its reading."""
    if dials.indicator_um is None:
        return (_SIM, *_scale(None), dim(" " + text("align_page.dial.free")))
    reading_mm = dials.indicator_um / 1000.0
    pushed = text.units.show(reading_mm, "mm", 3, "+")
    if abs(dials.indicator_um) >= RANGE_UM:
        pushed = text("align_page.dial.end")
    return (_SIM, *_scale(dials.indicator_um), *line(" " + pushed))


def contact_line(text: Catalogue, dials: Dials) -> Line:
    """Return whether the tool is heard on the part and its current, or what the micrometer reads."""
    if dials.micrometer_mm is not None:
        return line(_SIM, text("align_page.micrometer", value=text.units.show(dials.micrometer_mm, "mm", 3)))
    current = text("align_page.current", value=f"{dials.tool_current_percent:.0f}")
    if dials.contact:
        return line(_SIM, ("● " + text("align_page.contact"), Token.STRONG), ", " + current)
    return line(_SIM, "○ " + text("align_page.no_contact"), dim(", " + current))


def _scale(reading_um: float | None) -> Line:
    """Return the scale, with the needle unless the stylus is free."""
    cells = ["─"] * CELLS
    cells[0], cells[CELLS // 2], cells[-1] = "├", "┼", "┤"
    if reading_um is None:
        return (dim("".join(cells)),)
    share = (max(-RANGE_UM, min(reading_um, RANGE_UM)) + RANGE_UM) / (2.0 * RANGE_UM)
    at = round(share * (CELLS - 1))
    return (dim("".join(cells[:at])), ("●", Token.STRONG), dim("".join(cells[at + 1 :])))


def seen_lines(text: Catalogue, jog: JogView, width: int) -> list[Line]:
    """Return what is visible on the simulated lathe; on a real one, how to find it out."""
    if not jog.state.simulated:
        return wrap_line(text("align_page.real"), width)
    seen = None if jog.state.activity is Activity.LOST else jog.state.seen
    mark: Piece = ("SIM", Token.SIM)
    if seen is None:
        return [line(mark, dim(" " + text("align_page.not_seen"))), BLANK]
    if seen.dials is not None:
        return [dial_line(text, seen.dials), contact_line(text, seen.dials)]
    return [line(mark, " " + jaw_words(text, seen, jog.machine)), line(mark, " " + gap_words(text, seen))]


def _of_step(seen: list[Line], state: StationState) -> list[Line]:
    """Return what is seen of jaw 1 until it is found, then of the tool; of a real lathe everything."""
    if not state.simulated or state.seen is None:
        return seen
    return seen[:1] if state.alignment.jaw is None else seen[1:]


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
        return text("align_page.gap", gap=text.units.show(gap, "mm", 3))
    if seen.in_scratch:
        return text("align_page.touches_scratched")
    return text("align_page.touches", depth=text.units.show(abs(gap), "mm", 3))


@lru_cache(maxsize=4)
def chuck_lines(columns: int, rows: int, jaws: int, jaw_1_past_mark_deg: float) -> tuple[Line, ...]:
    """Return the picture, none in too few cells; the mark is at 3 o'clock, angles count counter-clockwise."""
    if columns < LEAST_COLUMNS or rows < LEAST_ROWS:
        return ()
    canvas = BrailleCanvas(columns, rows)
    centre_x, centre_y = columns - 1.0, 2.0 * rows - 0.5
    radius = min(centre_y, centre_x - 2.0 * _BESIDE)
    turn = np.radians(np.arange(0.0, 361.0, 3.0))
    canvas.polyline(centre_x + radius * np.cos(turn), centre_y - radius * np.sin(turn), _RIM)
    for jaw in reversed(range(jaws)):
        angle = math.radians(jaw_1_past_mark_deg + 360.0 * jaw / jaws)
        reach = np.array([_JAW_FRACTION * radius, radius - 1.0])
        layer = _JAW_1 if jaw == 0 else _JAW
        for shift in (-1.0, 0.0, 1.0):
            x = centre_x + reach * math.cos(angle) - shift * math.sin(angle)
            y = centre_y - reach * math.sin(angle) - shift * math.cos(angle)
            canvas.polyline(x, y, layer)
    angle, inner = math.radians(jaw_1_past_mark_deg), 0.3 * radius
    row, column = (centre_y - inner * math.sin(angle)) // 4, (centre_x + inner * math.cos(angle)) // 2
    cells = Cells.blank(columns, rows)
    cells.lay(canvas, 0, 0, (Token.RING, Token.AXIS, Token.MARK))
    cells.write(int(row), int(column), "1", Token.MARK)
    cells.write(int(centre_y // 4), int((centre_x + radius) // 2) + 1, "◂", Token.MARK)
    return tuple(map(_line, cells.text_rows(), cells.tokens.tolist()))


def _line(characters: str, tokens: list[int]) -> Line:
    runs = groupby(zip(characters, tokens, strict=True), key=itemgetter(1))
    return tuple(("".join(character for character, _ in run), Token(token)) for token, run in runs)
