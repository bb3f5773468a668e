"""The far end of `benchmarks.stop_latency`: the operator's terminal, and the line between a console and a card.

One loop in one thread does it all, so that the time of a key and that of the byte that it leads to are comparable.
A line with a speed is one character after another in both directions; the console's side of it is a pty, which has
no speed of its own.
"""

from __future__ import annotations

import json
import os
import random
import select
import socket
import struct
import subprocess
import time
import tty
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field

from benchmarks.command_rate import connect, said
from drivers.lathe.stop import KILL_ALL
from drivers.link.serial import CHARACTER_BITS as CHARACTER_BITS
from drivers.pmac.ethernet import Direction, Request, RequestCode

CHUNK = 4096
LONGEST_S = 60.0
IDLE_S = 0.002
SETTLE_S = 2.0
"""Until a screen that is ready draws at its usual rate, and a terminal that is not read is full."""
GAPS_S = (0.02, 0.09)
KEY = b" "
DOUBLE = struct.Struct("d")

STOP_REQUEST = Request(
    direction=Direction.DOWNLOAD, code=RequestCode.GETRESPONSE, length=len(KILL_ALL), data=KILL_ALL
).encode()


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """The ports of a simulated card on this machine."""

    tcp: int
    ethernet: int


def card_of(simulator: subprocess.Popen[str]) -> Card:
    """Return where a simulator with both listeners says that it is."""
    ports = [int(json.loads(said(simulator))["listening"].rpartition(":")[2]) for _ in range(2)]
    return Card(tcp=ports[0], ethernet=ports[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopped:
    """One stop: when its key was pressed, when it was called, when its byte had come; and how many came before."""

    pressed_s: float
    called_s: float
    wire_s: float
    in_front: int


@dataclass(kw_only=True)
class Way:
    """One direction of a line: a character after the other, each `byte_s` long.

    What comes is taken at once, and given to the other end when a line of that speed would have carried it.
    """

    source: int
    sink: int
    byte_s: float
    _free_s: float = 0.0
    _waiting: deque[tuple[float, bytes]] = field(default_factory=deque)

    def take(self) -> list[tuple[float, int]]:
        """Take what has come; return each character with the time at which it will be, or is, on the wire."""
        now_s, data = time.monotonic(), os.read(self.source, CHUNK)
        if not self.byte_s:
            os.write(self.sink, data)
            return [(now_s, character) for character in data]
        found = []
        for character in data:
            self._free_s = max(self._free_s, now_s) + self.byte_s
            self._waiting.append((self._free_s, bytes([character])))
            found.append((self._free_s, character))
        return found

    def give(self) -> float:
        """Give what has been carried to the other end; return how long until there is more, s."""
        while self._waiting:
            left_s = self._waiting[0][0] - time.monotonic()
            if left_s > 0.0:
                return left_s
            os.write(self.sink, self._waiting.popleft()[1])
        return IDLE_S


@dataclass(kw_only=True)
class UiContext:
    """Operator, terminal and line. `stop` is how a stop looks on the line; `calls` tells when it was called."""

    terminal: int
    calls: int
    there: Way
    back: Way
    stop: bytes
    listening: socket.socket | None = None
    stalled: bool = False
    _carried: list[tuple[float, int]] = field(default_factory=list)
    _called_s: list[float] = field(default_factory=list)

    def wait_until_ready(self) -> None:
        """Wait for the console, and for the load that it is under."""
        if self.listening is not None:
            self.listening.settimeout(LONGEST_S)
            near, _ = self.listening.accept()
            near.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.there.source = self.back.sink = near.detach()
        self._go_on(lambda: bool(self._called_s), LONGEST_S)
        end_s = time.monotonic() + SETTLE_S
        self._go_on(lambda: time.monotonic() >= end_s, LONGEST_S)

    def hang_up(self) -> None:
        """Let go of what was accepted."""
        if self.listening is not None and self.there.source >= 0:
            os.close(self.there.source)

    def stops(self, count: int) -> list[Stopped]:
        """Press the key so often, each time after a gap of some other length."""
        chance = random.Random(7)
        return [self._stopped(chance.uniform(*GAPS_S)) for _ in range(count)]

    def _stopped(self, gap_s: float) -> Stopped:
        end_s = time.monotonic() + gap_s
        self._go_on(lambda: time.monotonic() >= end_s, LONGEST_S)
        self._called_s.clear()
        pressed_s = time.monotonic()
        self._carried = [each for each in self._carried if each[0] > pressed_s]
        os.write(self.terminal, KEY)
        self._go_on(lambda: self._stop_at() >= 0 and bool(self._called_s), LONGEST_S)
        (called_s,), at = self._called_s, self._stop_at()
        in_front = sum(at_s > called_s for at_s, _ in self._carried[:at])
        wire_s, _ = self._carried[at + len(self.stop) - 1]
        return Stopped(pressed_s=pressed_s, called_s=called_s, wire_s=wire_s, in_front=in_front)

    def _stop_at(self) -> int:
        return bytes(character for _, character in self._carried).find(self.stop)

    def _go_on(self, done: Callable[[], bool], timeout_s: float) -> None:
        """Let the world go on until something is so.

        Raises:
            TimeoutError: it did not come to that.
        """
        end_s = time.monotonic() + timeout_s
        while not done():
            if time.monotonic() > end_s:
                raise TimeoutError("the console says nothing")
            wait_s = min(self.there.give(), self.back.give(), IDLE_S)
            ends = [self.there.source, self.back.source, self.calls]
            readable, _, _ = select.select(ends if self.stalled else [*ends, self.terminal], [], [], wait_s)
            if self.there.source in readable:
                self._carried += self.there.take()
            if self.back.source in readable:
                self.back.take()
            if self.calls in readable:
                self._called_s += DOUBLE.unpack(os.read(self.calls, DOUBLE.size))
            if self.terminal in readable:
                os.read(self.terminal, CHUNK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """What the console's process is given, and the desk around it."""

    address: str
    pipe: int
    terminal: int
    ui: UiContext


def bench(stack: ExitStack, link: str, baud: int, byte_s: float, card: Card) -> Bench:
    """Lay a line of a kind to a card, and put up a terminal."""
    screen, terminal = _pty(stack)
    tty.setcbreak(terminal)
    calls, pipe = os.pipe()
    for end in (calls, pipe):
        stack.callback(os.close, end)
    far = stack.enter_context(connect(card.ethernet if link == "ethernet" else card.tcp))
    listening: socket.socket | None = None
    if link == "serial":
        near, device = _pty(stack)
        tty.setraw(device)
        address = f"serial:{os.ttyname(device)}?baud={baud}"
    else:
        listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        near, address = -1, f"{link}:127.0.0.1:{listening.getsockname()[1]}"
    ui = UiContext(
        terminal=screen,
        calls=calls,
        there=Way(source=near, sink=far.fileno(), byte_s=byte_s),
        back=Way(source=far.fileno(), sink=near, byte_s=byte_s),
        stop=STOP_REQUEST if link == "ethernet" else KILL_ALL,
        listening=listening,
    )
    stack.callback(ui.hang_up)
    return Bench(address=address, pipe=pipe, terminal=terminal, ui=ui)


def _pty(stack: ExitStack) -> tuple[int, int]:
    ends = os.openpty()
    for end in ends:
        stack.callback(os.close, end)
    return ends
