"""Identification of the controller."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.commands.handler import Handler
from drivers.simulator.context import Context

_SPELLINGS = {
    "VERSION": "VERSION",
    "VER": "VERSION",
    "TYPE": "TYPE",
    "DATE": "DATE",
    "CID": "CID",
    "CPU": "CPU",
    "VID": "VID",
    "CHECKSUM": "CHECKSUM",
    "CHKS": "CHECKSUM",
    "TIME": "TIME",
    "TODAY": "TODAY",
}


def _identify(word: str) -> Handler:
    def command(_: Scanner, context: Context) -> None:
        reply = context.dialect.replies.get(word)
        if reply is None:
            raise PmacError(ErrorCode.DATA_ERROR, f"{word} is no word of this family")
        context.lines.append(reply)

    return command


WORDS: dict[str, Handler] = {spelling: _identify(word) for spelling, word in _SPELLINGS.items()}
"""The replies, and which words a family has, are in its dialect."""
