"""A line between a console and a served lathe that can be cut and mended: a socket, or a serial device.

A thread carries the bytes both ways. Cut, both connections end, and none is made before it is mended; a serial
device is gone meanwhile, as an adapter that is unplugged.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import tty
from contextlib import suppress
from pathlib import Path
from typing import Self

CHUNK = 65_536
TICK_S = 0.02


class CuttableLine:
    """Use it as a context manager; `address` is what the console is given. `connections` counts them."""

    def __init__(self, kind: str, upstream: tuple[str, int], folder: Path) -> None:
        self._kind, self._upstream, self._name = kind, upstream, folder / "ttyLathe"
        self._whole, self._ended = threading.Event(), threading.Event()
        self._cut_now = threading.Event()
        self._port = 0
        self.connections = 0
        self._lock = threading.Lock()
        self._listener: socket.socket | None = None
        if kind != "serial":
            self._listen()
            self.address = f"{kind}:127.0.0.1:{self._port}"
        else:
            self.address = f"serial:{self._name}?baud=4000000"
        self._whole.set()
        self._thread = threading.Thread(target=self._run, name="line", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        if self._kind == "serial":
            while not self._name.exists():
                self._ended.wait(TICK_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.cut()
        self._thread.join(5.0)

    def cut(self) -> None:
        """Cut what is connected; nobody connects any more."""
        self._whole.clear()
        with self._lock:
            if self._listener is not None:
                self._listener.close()
                self._listener = None

    def mend(self) -> None:
        """Let the console connect again, at the same address."""
        if self._kind != "serial":
            self._listen()
        self._whole.set()

    def _listen(self) -> None:
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", self._port))
        listener.listen()
        self._port = listener.getsockname()[1]
        with self._lock:
            self._listener = listener

    def _run(self) -> None:
        while not self._ended.is_set():
            if not self._whole.wait(TICK_S):
                continue
            if self._kind == "serial":
                self._carry_serial()
            else:
                self._carry_socket()

    def _carry_socket(self) -> None:
        with self._lock:
            listener = self._listener
        if listener is None:
            return
        with suppress(OSError, ValueError):
            if not select.select([listener], [], [], TICK_S)[0]:
                return
            console, _ = listener.accept()
            with console:
                self._carry(console.fileno())

    def _carry_serial(self) -> None:
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        self._name.symlink_to(os.ttyname(theirs))
        try:
            self._carry(ours)
        finally:
            self._name.unlink()
            os.close(ours)
            os.close(theirs)

    def _carry(self, console: int) -> None:
        """Pass bytes on until the line is cut, or one side ends."""
        self.connections += 1
        with socket.create_connection(self._upstream) as lathe, suppress(OSError):
            lathe.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while self._whole.is_set() and not self._ended.is_set():
                for end in select.select([console, lathe.fileno()], [], [], TICK_S)[0]:
                    data = os.read(end, CHUNK)
                    if not data:
                        return
                    os.write(lathe.fileno() if end == console else console, data)
