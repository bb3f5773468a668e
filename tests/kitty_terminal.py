"""A terminal that speaks the keyboard protocol of kitty, by its specification: a stack of flags, set and asked.

What is typed is encoded by the test: a press as ever, `CSI 5;1:2~` for a repeat of PgUp, `:3` for its release.
"""

from __future__ import annotations

import re

from tests.terminal import Terminal

FLAGS = re.compile(rb"\x1b\[([<>=?])(\d*)(?:;(\d+))?u")
UNFINISHED = re.compile(rb"\x1b(?:\[[<>=?]?[\d;]*)?\Z")


class KittyTerminal(Terminal):
    """`flags`: the stack, the lowest being those of the shell that the program was started from."""

    flags: tuple[int, ...] = (0,)
    _rest = b""

    def _answer(self, data: bytes) -> bytes:
        data = self._rest + data
        tail = UNFINISHED.search(data)
        self._rest = b"" if tail is None else tail[0]
        answers = b""
        for kind, number, _ in FLAGS.findall(data[: len(data) - len(self._rest)]):
            match kind.decode():
                case "?":
                    answers += b"\x1b[?%du" % self.flags[-1]
                case ">":
                    self.flags = (*self.flags, int(number or 0))
                case "<":
                    self.flags = self.flags[: -int(number or 1)] or (0,)
                case _:
                    self.flags = (*self.flags[:-1], int(number or 0))
        return answers
