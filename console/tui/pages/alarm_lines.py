"""Text of the alarms of this session: one row each, the selected one in full, rate and the most frequent ones."""

from __future__ import annotations

from datetime import datetime

from console.session.station.history.alarm_history import (
    FLOOD_S,
    HOUR_S,
    RAISES_MOST,
    AlarmEntry,
    AlarmHistory,
    AlarmState,
)
from console.text.catalogue import Catalogue
from console.tui.frame import MARKS
from console.tui.lines import BLANK, Line, dim, fit_text, hanging, line, to_the_right, wrap_line
from console.tui.theme import Token

_NUMBER, _TIME, _STATE, _FIRST = 5, 9, 13, 10
_TOKENS = {AlarmState.NEW: Token.ALARM, AlarmState.RETURNED: Token.WARNING, AlarmState.ACKNOWLEDGED: Token.TEXT}
FREQUENT = 3


def clock(at: datetime) -> str:
    """Return a local time as the lists show it."""
    return at.strftime("%H:%M:%S")


def alarm_lines(history: AlarmHistory, selected: int, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the heading and the rows around the selected place; cost by what is shown."""
    listed = history.list_entries
    first, room = window(len(listed), selected, height), max(height - 1, 1)
    number = to_the_right(text("alarms_page.number") + " ", 5 + _NUMBER)
    time, state = fit_text(text("alarms_page.time"), _TIME), fit_text(text("alarms_page.state"), _STATE + _FIRST)
    head = number + time + state + text("alarms_page.alarm")
    rows = [
        _row(history, entry, text, width, chosen=first + place == selected)
        for place, entry in enumerate(listed[first : first + room])
    ]
    return [line(dim(fit_text(head, width))), *rows][: max(height, 0)]


def window(count: int, selected: int, height: int) -> int:
    """Return the place of the first visible row, below the heading."""
    room = max(height - 1, 1)
    return min(max(selected - room // 2, 0), max(count - room, 0))


def _row(history: AlarmHistory, entry: AlarmEntry, text: Catalogue, width: int, *, chosen: bool) -> Line:
    state = entry.state
    mark = f"{'▸' if chosen else ' '}{MARKS[entry.alarm.priority]:<4}"
    times = f"×{entry.alarm.count} " if entry.alarm.count > 1 else ""
    first = text("alarms_page.first_out") if is_first_out(history, entry) else ""
    head = (
        f"{mark}{entry.number:>{_NUMBER - 1}} {fit_text(clock(entry.raised), _TIME)}"
        f"{fit_text(text(f'alarms_page.is.{state}'), _STATE)}{fit_text(first, _FIRST)}"
    )
    row = fit_text(head + times + text.problem(entry.problem), width)
    return ((row, Token.SELECTED if chosen else _TOKENS.get(state, Token.DIM)),)


def is_first_out(history: AlarmHistory, entry: AlarmEntry) -> bool:
    """Whether an alarm was the first of several."""
    return entry.group == entry.number and history.group_of(entry) > 1


def title_words(history: AlarmHistory, text: Catalogue) -> str:
    """Return how many alarms stand, and how many are over."""
    return text("alarms_page.title", standing=len(history.standing), past=len(history.past))


def rate_words(history: AlarmHistory, now_s: float, text: Catalogue) -> str:
    """Return how often alarms come, and whether that is a flood."""
    hour = history.rate(now_s, HOUR_S)
    more = f"{hour}{'+' if hour == RAISES_MOST else ''}"
    said = text("alarms_page.rate", minutes=history.rate(now_s, FLOOD_S), hour=more)
    return f"{said} · {text('alarms_page.flood')}" if history.is_flood(now_s) else said


def whole_lines(history: AlarmHistory, entry: AlarmEntry, text: Catalogue, width: int) -> list[Line]:
    """Return the whole text of an alarm, then its times and its group."""
    token = Token.ALARM if entry.state is AlarmState.NEW else Token.TEXT
    said = [text("alarms_page.raised", at=clock(entry.raised))]
    if entry.again is not None:
        said.append(text("alarms_page.again", count=entry.alarm.count, at=clock(entry.again)))
    if entry.acknowledged is not None:
        said.append(text("alarms_page.acknowledged", at=clock(entry.acknowledged)))
    if entry.ended is not None:
        said.append(text("alarms_page.ended", at=clock(entry.ended)))
    if is_first_out(history, entry):
        said.append(text("alarms_page.first_of", count=history.group_of(entry) - 1))
    elif entry.group != entry.number:
        said.append(text("alarms_page.follows", number=entry.group))
    return [*wrap_line(text.problem(entry.problem), width, token), *wrap_line(" · ".join(said), width, Token.DIM)]


def whole_title(entry: AlarmEntry, text: Catalogue) -> str:
    """Return number, priority and state of an alarm."""
    priority = text(f"alarms_page.priority.{entry.alarm.priority.name.lower()}")
    return text(
        "alarms_page.whole", number=entry.number, priority=priority, state=text(f"alarms_page.is.{entry.state}")
    )


def frequent_lines(history: AlarmHistory, text: Catalogue, width: int) -> list[Line]:
    """Return the most frequent alarms of this session, a row each."""
    often = history.most_frequent(FREQUENT)
    return [
        line(dim(f"{times:>4}× "), fit_text(text.problem(problem), max(width - 6, 0))) for problem, times in often
    ]


def all_lines(
    history: AlarmHistory, entry: AlarmEntry | None, now_s: float, text: Catalogue, width: int
) -> list[Line]:
    """Return the selected alarm, the rate and the most frequent ones, uncut."""
    lines: list[Line] = []
    if entry is not None:
        lines += [line((whole_title(entry, text), Token.TITLE)), *whole_lines(history, entry, text, width), BLANK]
    lines += wrap_line(rate_words(history, now_s, text), width)
    often = history.most_frequent(FREQUENT)
    if often:
        lines += [BLANK, line((text("alarms_page.frequent"), Token.TITLE))]
    for problem, times in often:
        lines += hanging(dim(f"{times:>4}× "), text.problem(problem), width)
    return lines
