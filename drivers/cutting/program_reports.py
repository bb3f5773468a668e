"""What a running program reports of itself, read between two polls: its line. Only queries.

A report is worth less than a poll: it is not read over a slow line, a missing reply is not asked for again, and a
controller that does not know the query is never asked again.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass

from drivers.controller import Controller
from drivers.errors import ControllerError, LinkError
from drivers.lathe.polling import SLOW_LINE_S, Poller
from drivers.link.base import is_gone
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.text import format_line
from drivers.pmac.program_text import ProgramText

POLLS_A_REPORT = 12  # some three a second: each report costs the time of a poll
REPORT_TIMEOUT_S = 0.1  # less than what a poll may take: watchdog and polls come first
EXECUTED = "LIST PE"  # the line that is being executed, after its program and its address

_LISTED = re.compile(r"P(\d+):(\d+)(?::(.*))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramPlace:
    """The line that is executed: its program, its text, and its number in the loaded program, from 1.

    `line` is None where the text occurs several times: the address that the controller reports counts words of its
    memory, not lines. `lines` is how many the program has.
    """

    program: int
    text: str
    line: int | None
    lines: int


def place_of(reply: str, program: ProgramText) -> ProgramPlace | None:
    """Return the place named by a reply to `EXECUTED`; None if it names no line."""
    found = _LISTED.fullmatch(reply.strip())
    if found is None or not found[3]:
        return None
    number, text = int(found[1]), found[3]
    lines = {program.number: program.program, **program.subprograms}.get(number, ())
    with suppress(PmacError):
        text = format_line(parse_line(text))
    same = [place for place, line in enumerate(lines, start=1) if format_line(line) == text]
    return ProgramPlace(program=number, text=text, line=same[0] if len(same) == 1 else None, lines=len(lines))


class ProgramReports:
    """The reports of one program. `place` is the last line that was reported, None before."""

    def __init__(self, client: Controller, poller: Poller, program: ProgramText) -> None:
        self.place: ProgramPlace | None = None
        self._client, self._poller, self._program = client, poller, program
        self._polls = 0
        self._refused = False

    def read(self) -> None:
        """Take note of a poll, and query a report when it is due.

        Raises LinkError: the link is gone. A reply that is missing is left to the next round.
        """
        self._polls += 1
        due = self._polls % POLLS_A_REPORT == 0
        if not due or self._refused or self._poller.round_trip_s >= SLOW_LINE_S:
            return
        try:
            (reply, *_) = self._client.request(EXECUTED, REPORT_TIMEOUT_S) or ("",)
        except ControllerError:
            self._refused = True
        except LinkError as error:
            if is_gone(error):
                raise
        else:
            self.place = place_of(reply, self._program) or self.place
