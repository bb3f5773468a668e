"""The terminal: what goes over the link, and a typed query."""

from __future__ import annotations

from collections.abc import Sequence

from console.escaping import escaped_line
from console.tui.controller.errand import Errand
from console.tui.lines import Line, dim, hanging, line
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from drivers.requests.permitted_lines import Permission, RequestKind, permission
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import FAILED, LISTING_S, RECEIVED, REST_TIMEOUT_S, SENT, STOP, TrafficLine
from profiles.problem import Problem

ACK, BELL = "\x06", "\x07"
_TIME = 9  # columns
_TOKENS = {SENT: Token.STRONG, RECEIVED: Token.TEXT, STOP: Token.WARNING, FAILED: Token.WARNING}


def spoken_lines(spoken: Sequence[TrafficLine], began_s: float, width: int, most: int) -> list[Line]:
    """Return the newest `most` lines, oldest first; times in s from `began_s`."""
    rows: list[Line] = []
    for each in reversed(spoken):
        if not format_line(each):  # what a resynchronisation has thrown away
            continue
        rows = [*_lines(each, began_s, width), *rows]
        if len(rows) >= most:
            break
    return rows[-most:] if most > 0 else []


def _lines(each: TrafficLine, began_s: float, width: int) -> list[Line]:
    time = f"{each.at_s - began_s:{_TIME - 1}.2f} "
    refused = each.mark == RECEIVED and BELL in each.text
    token = Token.WARNING if refused else Token.DIM if each.poll else _TOKENS.get(each.mark, Token.TEXT)
    mark = dim((time if each.mark != RECEIVED else " " * _TIME) + f"{each.mark} ")
    return hanging(mark, format_line(each), width, token) or [(mark,)]


def format_line(each: TrafficLine) -> str:
    """Return the characters of a line; data lines of a reply are separated by a bar."""
    if each.mark == RECEIVED:
        body, ack, rest = each.text.partition(ACK)
        values = [part.strip(" \n") for part in body.replace(BELL, "BEL ").split("\r")]
        words = " │ ".join(part for part in values if part)
        return escaped_line(" ".join(part for part in (words, "ACK" if ack else "", rest) if part))
    return "".join(_name_character(character) for character in each.text.rstrip("\r"))


def _name_character(character: str) -> str:
    code = ord(character)
    return f"^{chr(code + 64)}" if code < 32 else escaped_line(character)


class TerminalView:
    """Shows the newest lines, or those up to `_end` once somebody scrolls or pauses."""

    def __init__(self, ui: UiContext) -> None:
        self.polls = False
        self._ui = ui
        self._errand: Errand[tuple[str, ...]] = Errand()
        self._last = ""
        self._end: int | None = None
        self._spoken: tuple[TrafficLine, ...] = ()
        self._newest: tuple[int, bool] = (-1, False)

    @property
    def running(self) -> bool:
        """Whether a query waits for its reply."""
        return self._errand.running

    @property
    def subtitle(self) -> str:
        """What is said in the frame: paused, and what is left out."""
        text = self._ui.text
        words = [] if self._end is None else [text("controller_page.terminal.paused")]
        return "  ".join([*words, text(f"controller_page.terminal.{'with' if self.polls else 'without'}_polls")])

    def ask(self, typed: str) -> None:
        """Send a query, and show it.

        Raises RefusedError: as `permission`; or `ProblemError`s of what it needs.
        """
        side = self._ui.control.side
        assert side is not None  # the page has seen it
        typed = typed.strip(" ").upper()
        allowed = permission(typed, side.dialect)
        self._last = typed
        reasons = self._why_not(allowed)
        if self._ui.answers(reasons):
            return
        client = SideController(side, allowed.kind)
        timeout_s = LISTING_S if allowed.kind is RequestKind.LISTING else REST_TIMEOUT_S

        def work() -> tuple[str, ...]:
            with side.working(reading=allowed.kind is RequestKind.LISTING):
                return client.request(typed, timeout_s, lines=allowed.lines)

        self._end = None
        self._errand.start(client, work)

    def ask_again(self) -> None:
        """Send the last query again."""
        self.ask(self._last)

    def why_not_again(self) -> tuple[Problem, ...]:
        """Return why the last query cannot be sent again."""
        if not self._last:
            return (Problem(code="screen.no_query"),)
        if self._ui.control.side is None:
            return (Problem(code="screen.no_controller"),)
        return (Problem(code="screen.query_waits"),) if self.running else ()

    def cancel(self) -> None:
        """Wait for the reply no longer."""
        self._errand.cancel()

    def pause(self) -> None:
        """Stay where the list is, or follow again."""
        side = self._ui.control.side
        newest = 0 if side is None else side.heard.newest(polls=self.polls)
        self._end = newest if self._end is None else None

    def scroll(self, by: int) -> None:
        """Show other lines; the newest again at the end."""
        numbers = [each.number for each in self._spoken]
        if not numbers:
            return
        place = len(numbers) - 1
        if self._end is not None:
            place = max((at for at, number in enumerate(numbers) if number <= self._end), default=0)
        place = max(place + by, 0)
        self._end = numbers[place] if place < len(numbers) - 1 else None

    def follow(self) -> None:
        """Take what a query has come to."""
        if self._errand.has_news and self._errand.problems:
            self._ui.key_answer = self._errand.problems

    def lines(self, width: int, height: int | None) -> list[Line]:
        """Return the lines that fit; without a height the newest hundreds."""
        side = self._ui.control.side
        if side is None:
            return [line(dim(self._ui.text("controller_page.no_trace")))]
        newest = side.heard.newest(polls=self.polls), self.polls
        if newest != self._newest:
            self._newest, self._spoken = newest, side.heard.list_traffic(polls=self.polls)
        end = self._end
        spoken = self._spoken if end is None else tuple(each for each in self._spoken if each.number <= end)
        return spoken_lines(spoken, side.heard.began_s, width, 500 if height is None else height)

    def _why_not(self, allowed: Permission) -> tuple[Problem, ...]:
        state = self._ui.control.state
        if self.running:
            return (Problem(code="screen.query_waits"),)
        if allowed.kind is not RequestKind.LISTING:
            return ()
        if not state.controls:
            return (Problem(code="beside.observer"),)
        if state.armed is not None:
            return (Problem(code="screen.controller_armed"),)
        return (Problem(code="beside.moves"),) if state.seen_moving or state.may_move else ()
