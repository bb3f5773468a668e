"""The words about program buffers, and the numbers of programs and PLCs."""

from __future__ import annotations

import re

HIGHEST_PROGRAM = 32_767
HIGHEST_PLC = 31

PROGRAM = ("PROGRAM", "PROG")
OPEN_PROGRAM = tuple(f"OPEN{word}" for word in PROGRAM)
OPEN_PLC = ("OPENPLC",)
CLEAR = ("CLEAR", "CLR")
CLOSE = ("CLOSE", "CLS")

_SPACES = r"\s*"
TRAILING_CLOSE = re.compile(f"(?:{'|'.join(map(_SPACES.join, CLOSE))}){_SPACES}$", re.IGNORECASE)
"""CLOSE at the end of a line that is stored; white space may stand anywhere in it."""
