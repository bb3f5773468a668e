"""When a running cut may be held, resumed or changed, and by how much."""

from __future__ import annotations

from console.session.station.commands import Adjust, HoldFeed, ResumeFeed
from console.session.station.state import Activity, StationState
from drivers.cutting.bounds import STEPS, Adjustable, Bounds
from profiles.problem import Problem

IN_PART = "cut"  # of `CutStage`: what it imports is not there for the first page

UNITS = {Adjustable.OVERRIDE: "%", Adjustable.GAIN: "%", Adjustable.PHASE: "deg"}


def hold_refusal(command: HoldFeed | ResumeFeed, state: StationState) -> Problem | None:
    """Return why a cut cannot be held, or resumed, now."""
    cut = state.cut
    if state.activity is not Activity.CUTTING or cut is None:
        return Problem(code="session.nothing_to_hold")
    if isinstance(command, ResumeFeed):
        return None if state.paused else Problem(code="cut.not_held")
    if cut.hold_from_mm is None:
        return Problem(code="cut.no_hold")
    if cut.holding:
        return Problem(code="screen.holding_already")
    if cut.hold.active:
        return Problem(code="cut.hold_asked")
    if cut.stage != IN_PART or cut.z_mm < cut.hold_from_mm:
        return Problem(code="cut.hold_early", limit=f"Z >= {max(cut.hold_from_mm, 0.0):.1f} mm")
    return None


def adjust_refusal(command: Adjust, state: StationState) -> Problem | None:
    """Return why a running cut cannot be changed so now: it does not allow it, or is at its bound."""
    cut = state.cut
    if state.activity is not Activity.CUTTING or cut is None:
        return Problem(code="session.nothing_to_adjust")
    if code := cut.adjusted.bounds.refusal_code(command.what):
        return Problem(code=code)
    if cut.holding:
        return Problem(code="screen.holding_already")
    if cut.hold.active:
        return Problem(code="cut.adjust_held")
    if cut.stage != IN_PART:
        return Problem(code="cut.adjust_early")
    return find_bound_problem(
        command.what, step_value(command, cut.adjusted.value_of(command.what)), cut.adjusted.bounds
    )


def step_value(command: Adjust, value: float) -> float:
    """Return a value some steps further."""
    return value + command.steps * STEPS[command.what]


def find_bound_problem(what: Adjustable, value: float, bounds: Bounds) -> Problem | None:
    """Return the problem of a value beyond the bounds, with what bounds an override."""
    low, high = bounds.range_of(what)
    if low <= value <= high:
        return None
    unit = UNITS[what]
    code = "cut.trim_bound"
    if what is Adjustable.OVERRIDE:
        code = f"cut.override_bound_{_KINDS.get(bounds.low_by if value < low else bounds.high_by, 'machine')}"
    shown = f"{low:g} … {high:g} {unit}"
    return Problem(code=code, key=what, value=f"{value:g} {unit}", limit=shown)


_KINDS = {"inverse": "inverse", "response": "inverse", "widest": "widest"}
"""What bounds an override: the inverse of the servo, the widest band offered, or else a limit of the machine."""
