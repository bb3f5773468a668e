"""Who controls the machine, in the words of the frame."""

from __future__ import annotations

from datetime import UTC, datetime

from console.session.station.state import StationState
from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim
from console.tui.theme import Token
from drivers.lathe.standing import BY_SSH


def observing(text: Catalogue, state: StationState, clock: datetime) -> str:
    """Return what an observer is told: who controls the machine, since when by the clock of this computer."""
    if not state.holder:
        return text("frame.looks_on_free")
    by = state.held_by
    if by is None:
        return text("frame.looks_on", holder=state.holder)
    since = _since(by.minute, clock)
    if by.host == BY_SSH or is_address(by.host):
        return text("frame.looks_on_far", name=by.name, client=by.shown_host, since=since)
    return text("frame.looks_on_named", name=by.name, host=by.shown_host, since=since)


def is_address(host: str) -> bool:
    """Whether a signed computer is an address: that of a terminal by SSH, for computers sign their names."""
    return set(host) <= set("0123456789abcdefABCDEF:.") and ("." in host or ":" in host)


def place(text: Catalogue, state: StationState, client: str) -> Line:
    """Return where this terminal is, for a real machine that it is not at; else nothing."""
    if not client or state.simulated:
        return ()
    return ((f"{text('frame.by_ssh', client=client)}   ", Token.WARNING),)


def _since(minute: int, clock: datetime) -> str:
    """Return the time of day; another day's with its date."""
    at = datetime.fromtimestamp(60 * minute, UTC).astimezone(clock.tzinfo)
    return f"{at:%H:%M}" if at.date() == clock.date() else f"{at:%Y-%m-%d %H:%M}"


def onlookers(text: Catalogue, state: StationState) -> Line:
    """Return how many look on, for the console in control; nothing where nobody does."""
    if not state.onlookers or not state.controls:
        return ()
    return (dim(f"{text('frame.onlookers', count=state.onlookers)}   "),)
