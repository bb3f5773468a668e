"""What must end before a command is accepted. Its imports are light: the first page needs it."""

from __future__ import annotations

from console.session.station.state import Activity, StationState
from profiles.problem import Problem

_REFUSALS = {
    "lost": "session.lost",
    "stopping": "screen.in_motion",
    "stopped": "screen.stopped_first",
    "connecting": "screen.nothing_known",
    "moving": "screen.in_motion",
    "busy": "screen.busy",
    "observing": "screen.observes",
}


def waiting(state: StationState) -> str:
    """Return what must end before a command is accepted, in a word; empty for nothing."""
    if state.activity is Activity.LOST:
        return "lost"
    if state.stop is not None:
        return "stopping" if state.stop.rest_s is None else "stopped"
    if not state.controls and state.activity is not Activity.CONNECTING:
        return "observing"
    if state.snapshot is None or state.activity is Activity.CONNECTING:
        return "connecting"
    if state.moving:
        return "stopping" if state.activity is Activity.STOPPING else "moving"
    return "" if state.activity is Activity.READY else "busy"


def wait_problems(state: StationState, key: str) -> tuple[Problem, ...]:
    """Return why the station cannot take a command now, empty if it can; `key` is how its key is written."""
    word = waiting(state)
    return (Problem(code=_REFUSALS[word], key=key),) if word else ()
