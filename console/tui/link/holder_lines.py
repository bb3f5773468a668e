"""Who controls the machine, in the words of the frame."""

from __future__ import annotations

from datetime import UTC, datetime

from console.session.station.state import StationState
from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim


def observing(text: Catalogue, state: StationState, clock: datetime) -> str:
    """Return what an observer is told: who controls the machine, since when by the clock of this computer."""
    if not state.holder:
        return text("frame.looks_on_free")
    by = state.held_by
    if by is None:
        return text("frame.looks_on", holder=state.holder)
    return text("frame.looks_on_named", name=by.name, host=by.host or "?", since=_since(by.minute, clock))


def _since(minute: int, clock: datetime) -> str:
    """Return the time of day; another day's with its date."""
    at = datetime.fromtimestamp(60 * minute, UTC).astimezone(clock.tzinfo)
    return f"{at:%H:%M}" if at.date() == clock.date() else f"{at:%Y-%m-%d %H:%M}"


def onlookers(text: Catalogue, state: StationState) -> Line:
    """Return how many look on, for the console in control; nothing where nobody does."""
    if not state.onlookers or not state.controls:
        return ()
    return (dim(f"{text('frame.onlookers', count=state.onlookers)}   "),)
