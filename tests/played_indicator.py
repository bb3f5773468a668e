"""A digital indicator at the far end of a real line, played by a thread."""

from __future__ import annotations

import os
import select
import threading
import tty
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest


@dataclass
class Instrument:
    """An indicator at the other end of a line: it answers each of the requests that it knows."""

    near: int
    device: str
    replies: dict[bytes, bytes]
    asked: list[bytes] = field(default_factory=list)

    def play(self, end: int) -> None:
        """Answer until the test ends."""
        while True:
            ready, _, _ = select.select([self.near, end], [], [])
            if end in ready:
                return
            self.asked.append(os.read(self.near, 64))
            os.write(self.near, self.replies.get(self.asked[-1], b""))


@pytest.fixture
def instrument() -> Iterator[Instrument]:
    near, far = os.openpty()
    tty.setraw(far)
    end, over = os.pipe()
    made = Instrument(near, os.ttyname(far), {})
    playing = threading.Thread(target=made.play, args=(end,))
    playing.start()
    yield made
    os.write(over, b"!")
    playing.join()
    for each in (near, far, end, over):
        os.close(each)
