"""Text of the page Run after a stop, and while the state of the machine is unknown."""

from __future__ import annotations

from collections.abc import Sequence

from console.session.station.progress import CutProgress
from console.session.station.state import StationState, StopState, TouchedBlank
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, fact, first_fitting, wrap_line
from console.tui.theme import Token

LABEL_WIDTH = 13
TURNING_RPM = 1.0  # speed above which the spindle counts as turning; a disabled drive may creep a count or two


def stop_lines(text: Catalogue, state: StationState, width: int, height: int | None = None) -> list[Line]:
    """Return how the present stop ended, how it left the part, and what to do: this first in little room."""
    stop, speed_rpm = state.stop, state.spindle_rpm
    if stop is None:
        return []

    def row(key: str, value: str, token: Token) -> Line:
        return fact(text(f"run_page.stop.{key}"), value, width, label_width=LABEL_WIDTH, token=token)

    how = text("run_page.stop.kill") if stop.killed else text("run_page.stop.ramp")
    head, rows = _not_delivered(text, stop, width), [row("by", how, Token.TEXT)]
    if stop.rest_s is None:
        rows.append(row("rest", text("run_page.rest_unproven"), Token.WARNING))
    else:
        if stop.still_s is not None:
            rows.append(row("still", f"{stop.still_s - stop.sent_s:.1f} s", Token.TEXT))
        rows.append(row("rest", _times(text, stop, stop.rest_s), Token.TEXT))
    if speed_rpm is not None and abs(speed_rpm) >= TURNING_RPM:
        rows.append(spindle_line(text, speed_rpm, width))
    if stop.rest_s is not None:
        drives = text("run_page.drives_closed") if stop.can_retract else text("run_page.drives_open")
        rows.append(row("tool", *_tool(text, stop)))
        rows.append(row("drives", drives, Token.TEXT if stop.can_retract else Token.WARNING))
        if state.cut_to is not None:
            rows.append(row("part", cut_words(text, state.cut_to), Token.TEXT))
    mark = [] if stop.rest_s is None else mark_lines(text, state.marks_mm, width)
    remedy = wrap_line(_remedy(text, stop), width, Token.STRONG)
    whole, remedy_first = [*head, *rows, *mark, BLANK, *remedy], [*head, *remedy, BLANK, *mark, *rows]
    return first_fitting(height, text("panel.more"), whole, remedy_first)


def _times(text: Catalogue, stop: StopState, rest_s: float) -> str:
    rest = f"{rest_s - stop.sent_s:.1f} s"
    if stop.taken_s is None:
        return rest
    return text("run_page.stop.times", rest=rest, taken=f"{stop.taken_s - stop.sent_s:.2f} s")


def cut_words(text: Catalogue, touched: TouchedBlank) -> str:
    """Return how far the clamped blank is cut."""
    return text(
        "run_page.cut_to",
        z=text.units.figure(touched.to_mm, "mm", 1),
        length=text.units.figure(touched.of_mm, "mm", 1),
    )


def mark_lines(text: Catalogue, marks_mm: Sequence[float], width: int, page: str = "run_page") -> list[Line]:
    """Return where stops left the tool in the turning part, mm behind its face, and what that means for it."""
    if not marks_mm:
        return []
    places = ", ".join(text.units.figure(mark_mm, "mm", 1) for mark_mm in marks_mm)
    return wrap_line("! " + text(f"{page}.marked", z=places), width, Token.WARNING)


def cut_of_stop(state: StationState) -> CutProgress | None:
    """Return the progress of the cut that the present stop ended, None where it ended no cut."""
    return state.cut if state.stop is not None and state.stop.of_cut else None


def spindle_line(text: Catalogue, speed_rpm: float | None, width: int) -> Line:
    """Return whether the spindle turns, and how fast; a dash while that is not known."""
    value, token = NOTHING, Token.TEXT
    if speed_rpm is not None:
        turns = abs(speed_rpm) >= TURNING_RPM
        value = f"! {text('run_page.turns')} {speed_rpm:z.0f} rpm" if turns else text("run_page.still")
        token = Token.WARNING if turns else Token.TEXT
    return fact(text("run_page.stop.spindle"), value, width, label_width=LABEL_WIDTH, token=token)


def lost_lines(
    text: Catalogue, state: StationState, now_s: float, width: int, height: int | None = None
) -> list[Line]:
    """Return that the state is unknown, since when, and what to do; in little room what to do comes first."""
    rows = [] if state.stop is None else _not_delivered(text, state.stop, width)
    age_s = state.age_s(now_s)
    if age_s is None:
        return [*rows, *wrap_line(text("run_page.lost.never"), width, Token.WARNING)]
    since = wrap_line(text("run_page.lost.age", age=f"{age_s:.0f}"), width, Token.WARNING)
    advice = wrap_line(text("run_page.lost.remedy"), width, Token.STRONG)
    whole, advice_first = [*rows, *since, BLANK, *advice], [*rows, *advice, *since]
    return first_fitting(height, text("panel.more"), whole, advice_first)


def stale(lines: Sequence[Line]) -> list[Line]:
    """Return lines styled as stale values."""
    return [tuple((piece, Token.STALE) for piece, _ in pieces) for pieces in lines]


def _not_delivered(text: Catalogue, stop: StopState, width: int) -> list[Line]:
    if stop.delivered:
        return []
    return [*wrap_line(f"!!! {text('run_page.not_delivered')}", width, Token.ALARM), BLANK]


def _tool(text: Catalogue, stop: StopState) -> tuple[str, Token]:
    """Return where the tool is. It may be clear now, but a disabled drive does not hold it there."""
    if stop.tool_in_part:
        return "! " + text("run_page.tool_in_part"), Token.WARNING
    if stop.tool_in_part is None:
        return "? " + text("run_page.tool_unknown"), Token.WARNING
    if not stop.can_retract:
        return "? " + text("run_page.tool_not_held"), Token.WARNING
    return text("run_page.tool_out"), Token.TEXT


def _remedy(text: Catalogue, stop: StopState) -> str:
    if stop.rest_s is None:
        return text("run_page.remedy.wait")
    words = {None: ("unknown", "unknown_off"), False: ("clear", "not_held"), True: ("retract", "by_hand")}
    return text(f"run_page.remedy.{words[stop.tool_in_part][not stop.can_retract]}")
