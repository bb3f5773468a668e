"""The streams of the command line: nothing that is written steers the terminal, and any encoding will do."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, TextIO

from console.text.escaping import encodable, escaped


class EscapedOutput:
    """A text stream through which only harmless characters go; in all else it is the stream behind it."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text; return its own length, as streams do."""
        self._stream.write(encodable(escaped(text), self._stream.encoding))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def escape_streams() -> None:
    """Put it in front of both outputs, once."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, EscapedOutput):
            setattr(sys, name, EscapedOutput(stream))
