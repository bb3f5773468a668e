"""Parse the statements about other ports and programs: CMD, SEND, DISPLAY, and ENABLE and DISABLE PLC."""

from __future__ import annotations

import string
from collections.abc import Mapping

from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.reading import HIGHEST_PLC, Reader, parse_numbers
from drivers.pmac.language.syntax import Message, PlcSwitch

PORTS = ("S", "P", "R", "A")
"""Serial, parallel, dual-ported RAM, auxiliary serial."""

_CONTROL = 0x40
"""Offset of a control character from its letter."""

_LETTERS = tuple(string.ascii_uppercase)
_SWITCHES = {"ENABLEPLC": True, "ENAPLC": True, "DISABLEPLC": False, "DISPLC": False}
_TALKERS = {"COMMAND": "CMD", "CMD": "CMD", "SEND": "SEND"}
_WITH_PORT = {f"{word}{port}": (name, port) for word, name in _TALKERS.items() for port in ("", *PORTS)}


def is_control(text: str) -> bool:
    """Whether a text is one of the control characters that are written `^A` to `^Z`."""
    return len(text) == 1 and chr(ord(text) + _CONTROL) in _LETTERS


def control_letter(text: str) -> str:
    """Return the A of `^A`."""
    return chr(ord(text) + _CONTROL)


def _talk(scanner: Scanner, word: str) -> Message | None:
    name, port = _WITH_PORT[word]
    if scanner.accept("^"):
        letter = scanner.take_word(_LETTERS)
        if letter is None:
            raise scanner.refusal("expected a letter as in CMD^A")
        return Message(name, chr(ord(letter) - _CONTROL), port)
    return Message(name, _text(scanner), port) if scanner.peek('"') else None


def _display(scanner: Scanner, word: str) -> Message:
    place = scanner.take_integer()
    return Message("DISPLAY", _text(scanner), place=place)


def _text(scanner: Scanner) -> str:
    text = scanner.take_string()
    if text is None:
        raise scanner.refusal("expected a text in quotes")
    if not text.isprintable():
        raise scanner.refusal("control characters stand outside of quotes, as in CMD^A")
    return text


def _switch(scanner: Scanner, word: str) -> PlcSwitch:
    return PlcSwitch(_SWITCHES[word], parse_numbers(scanner, 0, HIGHEST_PLC))


MESSAGE_READERS: Mapping[str, Reader] = {
    **dict.fromkeys(_WITH_PORT, _talk),
    **dict.fromkeys(("DISPLAY", "DISP"), _display),
    **dict.fromkeys(_SWITCHES, _switch),
}
