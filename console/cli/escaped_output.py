"""Output streams of the command line: escape what would control the terminal, and support any encoding."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, TextIO

from console.text.escaping import encodable, escaped


class EscapedOutput:
    """Text stream that passes only harmless characters; otherwise it behaves as the wrapped stream."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text; return its unescaped length, as streams do."""
        self._stream.write(encodable(escaped(text), self._stream.encoding))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def escape_streams() -> None:
    """Wrap both output streams, once."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, EscapedOutput):
            setattr(sys, name, EscapedOutput(stream))
