"""What went over the link, as lines: requests, replies, stops; control characters by their names."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.escaping import escaped_line
from console.tui.lines import Line, dim, hanging
from console.tui.theme import Token
from drivers.beside.heard import FAILED, RECEIVED, SENT, STOP, Spoken

ACK, BELL = "\x06", "\x07"
_TIME = 9
_TOKENS = {SENT: Token.STRONG, RECEIVED: Token.TEXT, STOP: Token.WARNING, FAILED: Token.WARNING}


def spoken_lines(spoken: Sequence[Spoken], began_s: float, width: int, most: int) -> list[Line]:
    """Return the newest `most` lines, oldest first; times in s from `began_s`."""
    rows: list[Line] = []
    for each in reversed(spoken):
        if not shown(each):  # what a resynchronisation has thrown away
            continue
        rows = [*_lines(each, began_s, width), *rows]
        if len(rows) >= most:
            break
    return rows[-most:] if most > 0 else []


def _lines(each: Spoken, began_s: float, width: int) -> list[Line]:
    time = f"{each.at_s - began_s:{_TIME - 1}.2f} "
    refused = each.mark == RECEIVED and BELL in each.text
    token = Token.WARNING if refused else Token.DIM if each.poll else _TOKENS.get(each.mark, Token.TEXT)
    mark = dim((time if each.mark != RECEIVED else " " * _TIME) + f"{each.mark} ")
    return hanging(mark, shown(each), width, token) or [(mark,)]


def shown(each: Spoken) -> str:
    """Return the characters of a line; data lines of a reply are separated by a bar."""
    if each.mark == RECEIVED:
        body, ack, rest = each.text.partition(ACK)
        values = [part.strip(" \n") for part in body.replace(BELL, "BEL ").split("\r")]
        words = " │ ".join(part for part in values if part)
        return escaped_line(" ".join(part for part in (words, "ACK" if ack else "", rest) if part))
    return "".join(_named(character) for character in each.text.rstrip("\r"))


def _named(character: str) -> str:
    code = ord(character)
    return f"^{chr(code + 64)}" if code < 32 else escaped_line(character)
