"""What the rows and the list of messages show of a lost link, and of one that is back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, hanging, line
from console.tui.theme import Token
from drivers.link.base import GONE

if TYPE_CHECKING:
    from console.session.station.link.lost_link import LostLink  # not for the first paint

NONE = "–"
SILENCES = ("link.silent", "link.not_in_step")  # reasons of a stop for which nobody answered
SHORT_S = 10.0  # losses shorter than this are shown in tenths


def lost_step(text: Catalogue, state: StationState) -> str:
    """Return what to do about a lost link, or one that is back since; empty where neither is the case."""
    lost = state.lost_link
    if state.activity is Activity.LOST:
        # Not yet known to be lost: the stop is under way, and is sent again until the machine answers.
        if lost is None and state.stop is not None and not _is_gone(state):
            return text("lost_link.silent")
        if lost is None and (_is_gone(state) or state.controller):
            return text("frame.lost")
        if lost is None or not (state.controller or lost.for_ever):
            return text("frame.never_answered", attempts=0 if lost is None else lost.attempts)
        return _describe_lost_link(text, lost)
    if lost is None or lost.back_s is None:
        return ""
    if is_watched(state):
        return text("lost_link.watching", age=_age(lost))
    if not lost.validity:
        return ""
    valid, void = (_name_stamps(text, lost, holds=holds) for holds in (True, False))
    if lost.returned:
        return text("lost_link.returned", name=lost.returned, valid=valid, void=void)
    key = "lost_link.back" if state.controls else "lost_link.observing"
    return text(key, age=_age(lost), valid=valid, void=void)


def unanswered_step(text: Catalogue, state: StationState, now_s: float) -> str:
    """Return what to do about a motion of which nothing was heard for a moment; empty where it is heard of."""
    age_s = state.age_s(now_s)
    if age_s is None or not state.is_unanswered(now_s):
        return ""
    if state.stop is not None:
        return text("lost_link.silent")
    return text("frame.no_answer", age=f"{age_s:.1f}")


def stopping_key(state: StationState) -> str:
    """Return the words for a stop that is not proven yet: of a machine that was silent, that it answers again."""
    stop = state.stop
    answers = stop is not None and stop.reason in SILENCES and stop.taken_s is not None
    return "frame.stopping_again" if answers else "frame.stopping"


def is_watched(state: StationState) -> bool:
    """Whether the link is back, and the controller is watched while it ends its motion: no stop was sent yet."""
    lost, stop = state.lost_link, state.stop
    back = lost is not None and lost.back_s is not None and state.activity is Activity.STOPPING
    return back and stop is not None and not stop.delivered


def lost_rows(text: Catalogue, state: StationState, width: int) -> list[Line]:
    """Return in full why the link is not back yet, or what is valid now that it is; empty without a loss."""
    lost = state.lost_link
    if lost is None:
        return []
    if lost.problem is not None and lost.back_s is None:
        last = text("lost_link.last_attempt", problem=text.problem(lost.problem))
        return [BLANK, *hanging(("– ", Token.WARNING), last, width, Token.WARNING)]
    if not lost.validity:
        return []
    title = text("lost_link.title", age=_age(lost))
    if lost.returned:
        title = text("lost_link.returned_title", name=lost.returned)
    rows = [BLANK, line((title, Token.TITLE))]
    for each in lost.validity:
        mark, token = ("✓ ", Token.TEXT) if each.holds else ("✗ ", Token.WARNING)
        words = text(f"validity.{each.why}", stamp=text(f"stamp.{each.stamp}"), value=each.value)
        rows += hanging((mark, token), words, width, token)
    return rows


def _is_gone(state: StationState) -> bool:
    return any(alarm.active and alarm.problem.code in GONE for alarm in state.alarms)


def _describe_lost_link(text: Catalogue, lost: LostLink) -> str:
    if lost.returned and not lost.for_ever:
        return text("lost_link.returning")
    if lost.for_ever:
        return text("lost_link.for_ever")
    return text("lost_link.silent") if lost.silent else text("lost_link.trying", attempts=lost.attempts)


def _name_stamps(text: Catalogue, lost: LostLink, *, holds: bool) -> str:
    return ", ".join(text(f"stamp.{each.stamp}") for each in lost.validity if each.holds is holds) or NONE


def _age(lost: LostLink) -> str:
    return f"{lost.away_s:.1f}" if lost.away_s < SHORT_S else f"{lost.away_s:.0f}"
