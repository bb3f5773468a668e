"""When a feed hold of a cut may be asked for, and when a held cut may be resumed."""

from __future__ import annotations

from console.session.station.commands import HoldFeed, ResumeFeed
from console.session.station.state import Activity, StationState
from profiles.problem import Problem

IN_PART = "cut"  # of `CutStage`: what it imports is not there for the first page


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
