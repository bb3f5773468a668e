"""A controller that does not cooperate, at the end of a real socket or pseudo-terminal; every byte it got is kept.

One thread reads what hosts send, and keeps it; another one answers, honestly for some lines and then in its own
way. Memory stays bounded however much it floods, and both end with the block.
"""

from __future__ import annotations

import os
import re
import select
import socket
import struct
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue

from profiles.machine import MachineProfile
from tests.hostile.plausible_card import PlausibleCard
from tests.hostile.ways import End, Kind, Way

CHUNK = 65_536
POLL_S = 0.02
MOTION = re.compile(
    r"J[-+/=:^*]|HM|(?<![A-Z])B\d+\s*R|(?<![A-Z])[RSA](?![A-Z\d])|\bO[-+.\d]|\$\$?\s*$", re.IGNORECASE
)
"""A line of which a part moves or energises something."""

MOVING_CHARACTERS = {0x01: "^A", 0x12: "^R", 0x13: "^S"}
"""Control-A also closes loops."""


class HostileCard:
    """`address` is where it listens; `lines` and `controls` are what came, in order."""

    def __init__(self, kind: Kind, machine: MachineProfile, honest_lines: int) -> None:
        self.address = ""
        self.lines: list[str] = []
        self.controls: list[int] = []
        self._kind, self._honest = kind, honest_lines
        controller = machine.controller
        self._card = PlausibleCard(controller.variables, controller.axis_definitions)
        self._ended = threading.Event()

    @property
    def moved_by(self) -> list[str]:
        """The lines and control characters that would move a real machine."""
        programs, moving = False, []
        for line in self.lines:
            programs = (programs or "OPEN" in line.upper()) and "CLOSE" not in line.upper()
            if not programs and MOTION.search(line):
                moving.append(line)
        return moving + [MOVING_CHARACTERS[each] for each in self.controls if each in MOVING_CHARACTERS]

    def talk(self, host: int, end: Callable[[End], None]) -> None:
        """Serve one connection, a file descriptor, to its end."""
        asked: SimpleQueue[str] = SimpleQueue()
        gone = threading.Event()
        reader = threading.Thread(target=self._listen, args=(host, asked, gone), name="hostile ear")
        reader.start()
        way = self._kind.way()
        try:
            while not (self._ended.is_set() or gone.is_set()):
                with suppress(Empty):
                    if not self._answer(host, asked.get(timeout=POLL_S), way, gone, end):
                        break
        finally:
            gone.set()
            reader.join()

    def stop(self) -> None:
        """End every connection."""
        self._ended.set()

    @property
    def stopped(self) -> bool:
        """Whether it was ended."""
        return self._ended.is_set()

    def _answer(self, host: int, line: str, way: Way, gone: threading.Event, end: Callable[[End], None]) -> bool:
        """Answer one line; return whether the connection goes on."""
        reply = self._card.reply(line)
        self._honest -= 1
        for step in [reply] if self._honest >= 0 else way(line, reply):
            if isinstance(step, End):
                end(step)
                return False
            if isinstance(step, float):
                waited = 0.0
                while waited < step and not (gone.is_set() or self._ended.is_set()):
                    gone.wait(min(POLL_S, step - waited))
                    waited += POLL_S
            elif not self._write(host, step, gone):
                return False
        return True

    def _write(self, host: int, data: bytes, gone: threading.Event) -> bool:
        left = memoryview(data)
        while left and not (gone.is_set() or self._ended.is_set()):
            try:
                if select.select([], [host], [], POLL_S)[1]:
                    left = left[os.write(host, left) :]
            except BlockingIOError:
                continue
            except (OSError, ValueError):
                return False
        return not left

    def _listen(self, host: int, asked: SimpleQueue[str], gone: threading.Event) -> None:
        line = bytearray()
        while not (gone.is_set() or self._ended.is_set()):
            try:
                if not select.select([host], [], [], POLL_S)[0]:
                    continue
                data = os.read(host, CHUNK)
            except BlockingIOError:
                continue
            except (OSError, ValueError):
                data = b""
            if not data:
                gone.set()
                return
            for byte in data:
                if byte == 0x0D:
                    self.lines.append(line.decode("latin-1"))
                    asked.put(self.lines[-1])
                    line.clear()
                elif byte < 0x20:
                    self.controls.append(byte)
                    if byte == 0x18:
                        line.clear()
                else:
                    line.append(byte)


@contextmanager
def hostile_card(
    kind: Kind, transport: str, machine: MachineProfile, honest_lines: int = 0
) -> Iterator[HostileCard]:
    """Serve a controller that answers `honest_lines` lines, and then in its own way; tcp or serial."""
    card = HostileCard(kind, machine, honest_lines)
    serve = _serve_tcp if transport == "tcp" else _serve_serial
    with serve(card):
        yield card


@contextmanager
def _serve_tcp(card: HostileCard) -> Iterator[None]:
    def accept() -> None:
        while not card.stopped:
            with suppress(OSError):
                host, _ = listener.accept()
                with closing(host):
                    host.setblocking(False)
                    card.talk(host.fileno(), partial(_end, host))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(POLL_S)
        card.address = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
        thread = threading.Thread(target=accept, name="hostile card")
        thread.start()
        try:
            yield
        finally:
            card.stop()
            thread.join()


def _end(host: socket.socket, end: End) -> None:
    if end is End.BROKEN:
        host.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


@contextmanager
def _serve_serial(card: HostileCard) -> Iterator[None]:
    near, far = os.openpty()
    tty.setraw(far)
    os.set_blocking(near, False)
    card.address = f"serial:{os.ttyname(far)}?baud=4000000"
    closed = threading.Event()

    def end(_: End) -> None:
        closed.set()

    thread = threading.Thread(target=card.talk, args=(near, end), name="hostile card")
    thread.start()
    try:
        yield
    finally:
        card.stop()
        thread.join()
        os.close(near)
        os.close(far)
