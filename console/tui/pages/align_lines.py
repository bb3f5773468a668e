"""What the page Align says, as lines of text: where the axes are, what is done, what is missing, how to jog."""

from __future__ import annotations

import math

from rich.cells import cell_len

from console.session.alignment import (
    Alignment,
    AlignStep,
    current_step,
    force_problems,
    problems,
    step_problems,
)
from console.session.jogging import tool_radius_mm
from console.session.state import StationState
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, dim, fact, fitted, line, ranged, wrapped
from console.tui.theme import Token
from drivers.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.machine import MachineProfile

STALE_S = 1.0
"""A position older than this is not where the axis is."""

WIDEST_STAMP = 44
"""Columns in which a label and its value still read as one."""

NOTHING = "–"
_DONE, _CURRENT, _OPEN = "✓", "●", "○"
_LABEL_WIDTH, _POSITION_WIDTH, _ERROR_WIDTH, _HOMED_WIDTH = 10, 13, 8, 6


def axes_lines(
    text: Catalogue, state: StationState, machine: MachineProfile, now_s: float, width: int
) -> list[Line]:
    """Return the table of the axes, and below it what holds for all of them."""
    heads = (
        fitted("", _LABEL_WIDTH),
        to_the_right(text("align_page.position"), _POSITION_WIDTH),
        to_the_right(text("align_page.error"), _ERROR_WIDTH),
        to_the_right(text("align_page.homed"), _HOMED_WIDTH),
        " ",
        text("align_page.drive"),
    )
    stale = now_s - state.looked_s > STALE_S
    rows = [_axis_line(text, axis, state, machine, stale) for axis in _SHOWN_AXES]
    return [(dim("".join(heads)),), *rows, _drives_line(text, state, now_s, width)]


_SHOWN_AXES = (AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE)


def _axis_line(text: Catalogue, axis: AxisName, state: StationState, machine: MachineProfile, stale: bool) -> Line:
    label = dim(fitted(text(f"align_page.axis.{axis}"), _LABEL_WIDTH))
    if state.snapshot is None:
        columns = (_POSITION_WIDTH, _ERROR_WIDTH, _HOMED_WIDTH)
        return (label, dim("".join(to_the_right(NOTHING, width) for width in columns)), dim(f" {NOTHING}"))
    seen = state.snapshot.axis(axis)
    position, error = _position(axis, state.snapshot, machine, state.alignment)
    homed = "home_complete" in seen.flags
    token = Token.STALE if stale else Token.TEXT
    gap = _POSITION_WIDTH - cell_len(position)
    return (
        label,
        line(" " * gap)[0],
        (position, token),
        dim(to_the_right(error, _ERROR_WIDTH)),
        (to_the_right(_DONE if homed else _OPEN, _HOMED_WIDTH), Token.OK if homed else Token.WARNING),
        dim(" " + (text("align_page.on") if seen.closed else text("align_page.off"))),
    )


def _position(
    axis: AxisName, snapshot: Snapshot, machine: MachineProfile, alignment: Alignment
) -> tuple[str, str]:
    """Return where an axis is and its following error, both with their units."""
    seen = snapshot.axis(axis)
    match axis:
        case AxisName.TOOL:
            radius_mm = tool_radius_mm(seen.position, machine, alignment)
            return f"R {radius_mm:.4f} mm", f"{seen.following_error * machine.tool.count_um:.1f} um"
        case AxisName.CARRIAGE:
            per_mm = machine.carriage.counts_per_mm
            return f"{seen.position / per_mm:.3f} mm", f"{1000.0 * seen.following_error / per_mm:.1f} um"
        case AxisName.SPINDLE:
            per_deg = machine.spindle.counts_per_rev / 360.0
            return f"{angle_deg(snapshot, machine):.2f} °", f"{seen.following_error / per_deg:.2f} °"


def angle_deg(snapshot: Snapshot, machine: MachineProfile) -> float:
    """Return the angle of the spindle from its index, degrees in [0, 360) when it is written with two decimals."""
    turns = snapshot.spindle.position / machine.spindle.counts_per_rev
    return round(360.0 * (turns - math.floor(turns)), 2) % 360.0


def _drives_line(text: Catalogue, state: StationState, now_s: float, width: int) -> Line:
    if state.snapshot is None:
        return (dim(fitted(text("align_page.nothing_known"), width)),)
    age_s = now_s - state.looked_s
    if age_s > STALE_S:
        return ((fitted("! " + text("align_page.stale", age=f"{age_s:.0f} s"), width), Token.WARNING),)
    if state.snapshot.loops_closed:
        drives = dim(text("align_page.drives_on"))
    elif state.snapshot.loops_open:
        drives = dim(text("align_page.drives_off"))
    else:
        drives = ("! " + text("align_page.drives_partly"), Token.WARNING)
    moving = (text("align_page.moving"), Token.STRONG) if state.moving else dim(text("align_page.at_rest"))
    return ranged((drives,), (moving,), width)


def step_now(alignment: Alignment, job: Job | None) -> AlignStep | None:
    """Return the step to do now; without a job only what needs none."""
    if job is not None:
        return current_step(alignment, job)
    return next(
        (
            step
            for step in (AlignStep.VERIFY, AlignStep.DRIVES, AlignStep.HOME)
            if not _done(alignment, step, None)
        ),
        None,
    )


def _done(alignment: Alignment, step: AlignStep, job: Job | None) -> bool:
    if job is not None:
        return not step_problems(alignment, step, job)
    done = {
        AlignStep.VERIFY: alignment.settings == (),
        AlignStep.DRIVES: alignment.drives_on,
        AlignStep.HOME: alignment.homed,
        AlignStep.JAW: alignment.jaw is not None,
    }
    return done.get(step, False)


def step_lines(text: Catalogue, alignment: Alignment, job: Job | None) -> list[Line]:
    """Return the steps in their order, each with its mark."""
    now = step_now(alignment, job)
    rows = []
    for number, step in enumerate(AlignStep, start=1):
        words = f" {number} " + text(f"align_page.step.{step}")
        if _done(alignment, step, job):
            rows.append(line((_DONE, Token.OK), dim(words)))
        elif step is now:
            rows.append(line((_CURRENT + words, Token.ACTION)))
        else:
            rows.append(line(_OPEN + words))
    return rows


def is_valid(alignment: Alignment, job: Job | None) -> bool:
    """Whether tool and lobe would be in phase for this job."""
    return job is not None and not problems(alignment, job)


def why_lines(text: Catalogue, state: StationState, job: Job | None, width: int, height: int) -> list[Line]:
    """Return what to do now and why the alignment is not valid, or what it rests on when it is."""
    alignment = state.alignment
    if job is None:
        return clipped(wrapped(text("align_page.no_job"), width), height)
    if is_valid(alignment, job):
        return _stamps(text, alignment, min(width, WIDEST_STAMP))
    shown = wrapped(hint(text, state, job), width, Token.STRONG)
    for problem in problems(alignment, job):
        first, *rest = wrapped(text.problem(problem), width - 2)
        shown += [(dim("· "), *first), *((dim("  "), *more) for more in rest)]
    return clipped(shown, height)


def hint(text: Catalogue, state: StationState, job: Job) -> str:
    """Return in a sentence or two how the present step is done."""
    step = current_step(state.alignment, job)
    if step is AlignStep.CLAMP and drives_are_on(state):
        return text("align_page.hint.clamp_drives_on")
    if step is AlignStep.CLAMP and force_problems(job):
        return text("align_page.hint.clamp_refused")
    return text(
        f"align_page.hint.{step}",
        material=job.material,
        diameter=f"{job.diameter_mm:.3f}",
        radius=f"{job.radius_mm:.3f}",
        force=f"{job.chucking_force_n:.0f}",
        error=f"{job.lobe_error_um_pp:.1f}",
    )


def drives_are_on(state: StationState) -> bool:
    """Whether a loop is closed, or may be: as long as nothing is known the hands stay out."""
    return state.snapshot is None or not state.snapshot.loops_open


def _stamps(text: Catalogue, alignment: Alignment, width: int) -> list[Line]:
    rows = [line(("✓ " + text("align_page.valid"), Token.OK)), BLANK]
    stamps: list[tuple[str, str, str]] = []
    if alignment.clamping is not None:
        stamps.append(
            (text("align_page.stamp.force"), f"{alignment.clamping.force_n:.0f} N", alignment.clamping.at)
        )
    if alignment.jaw is not None:
        stamps.append((text("align_page.stamp.jaw"), f"{alignment.jaw.angle_deg:.2f} °", alignment.jaw.at))
    if alignment.touch_off is not None:
        stamps.append(
            (
                text("align_page.stamp.touch"),
                f"R {alignment.touch_off.zero_radius_mm:.3f} mm",
                alignment.touch_off.at,
            )
        )
    rows += [fact(label, f"{value}  {at}", width, label_width=10) for label, value, at in stamps]
    return rows


def clipped(lines: list[Line], height: int) -> list[Line]:
    """Return what fits; where something does not, the last row says so."""
    if len(lines) <= height:
        return lines
    return [*lines[: max(height - 1, 0)], (dim("…"),)][: max(height, 0)]


def to_the_right(text: str, width: int) -> str:
    """Return a text filled up with blanks on its left."""
    return " " * max(width - cell_len(text), 0) + text
