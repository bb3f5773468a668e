"""The process of the simulated lathe as a child: its channel, its error output, and copies of it.

Methods raise `OSError` and `ValueError`.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from typing import IO, Any

from drivers.simulator.hosts.frozen import ASKED
from profiles.files import printable
from profiles.own_values import from_json

REQUEST_TIMEOUT_S = 5.0
END_TIMEOUT_S = 2.0
CHUNK = 65_536
LAST_WORDS_BYTES = 2000


class Child:
    """The process, its channel and its error output."""

    def __init__(self, arguments: list[str]) -> None:
        # A file instead of a pipe: nothing reads it in normal operation, and it must not block then.
        self._complaints: IO[bytes] = tempfile.TemporaryFile()
        self._channel, theirs = socket.socketpair()
        self._kept = b""
        self._is_copy = False  # what serves is no child of ours, but of one that was
        # -P: do not import modules from the current folder.
        command = [sys.executable, "-P", "-m", "drivers.simulator", "--channel", str(theirs.fileno()), *arguments]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._complaints,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        except OSError:
            self._channel.close()
            self._complaints.close()
            raise
        finally:
            theirs.close()

    @property
    def alive(self) -> bool:
        """Whether it has not ended."""
        return not self._is_closed() if self._is_copy else self._process.poll() is None

    def ask(self, request: dict[str, Any], copies: list[FrozenCopy] | None = None) -> dict[str, Any]:
        """Send a request and return the reply; `copies` gets those that come with it."""
        self._channel.settimeout(REQUEST_TIMEOUT_S)
        self._channel.sendall(json.dumps(request).encode("ascii") + b"\n")
        return self.read(REQUEST_TIMEOUT_S, copies)

    def turn_to(self, channel: socket.socket, timeout_s: float) -> str:
        """Go on with the process at the other end of this channel; the one before ends. Return the device."""
        before, self._channel, self._kept = self._channel, channel, b""
        try:
            device = str(self.read(timeout_s)["ready"])
        except (OSError, ValueError, KeyError) as error:
            channel.close()
            self._channel = before
            raise ConnectionError(plain(error)) from error
        before.close()
        if not self._is_copy:
            self._wait()
        self._is_copy = True
        return device

    def read(self, timeout_s: float, copies: list[FrozenCopy] | None = None) -> dict[str, Any]:
        """Return the next message; `copies` gets those that come with it."""
        deadline = time.monotonic() + timeout_s
        while b"\n" not in self._kept:
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                raise TimeoutError("no answer")
            self._channel.settimeout(left_s)
            if copies is None:
                data = self._channel.recv(CHUNK)  # a copy that nobody asked for is closed by the system
            else:
                data, lines, _, _ = socket.recv_fds(self._channel, CHUNK, 1)
                copies += [FrozenCopy(socket.socket(fileno=line)) for line in lines]
            if not data:
                raise ConnectionError("ended")
            self._kept += data
        line, _, self._kept = self._kept.partition(b"\n")
        said = from_json(line)
        if not isinstance(said, dict):
            raise ValueError("no answer")
        return said

    def end(self, cause: Exception) -> str:
        """End it, and return the reason: the last line of its error output, if any, otherwise `cause`."""
        if self._is_copy:
            self._end_copy()
        self._channel.close()
        self._wait()
        with self._complaints as complaints:
            left = max(os.fstat(complaints.fileno()).st_size - LAST_WORDS_BYTES, 0)
            words = os.pread(complaints.fileno(), LAST_WORDS_BYTES, left).decode("utf-8", "replace").split("\n")
        return next((printable(line) for line in reversed(words) if line.strip()), plain(cause))

    def _wait(self) -> None:
        """Wait until our own child has ended, and kill it if it does not."""
        try:
            self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(END_TIMEOUT_S)

    def _end_copy(self) -> None:
        """Wait until the copy has closed its end, and kill all that is left of its session if it does not."""
        with suppress(OSError):
            self._channel.shutdown(socket.SHUT_WR)
            self._channel.settimeout(END_TIMEOUT_S)
            while self._channel.recv(CHUNK):
                pass
            return
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def _is_closed(self) -> bool:
        """Whether the other end of the channel is closed: it belongs to the copy alone."""
        self._channel.setblocking(False)
        try:
            return self._channel.recv(1, socket.MSG_PEEK) == b""
        except BlockingIOError:
            return False
        except OSError:
            return True


class FrozenCopy:
    """A checkpoint: the line to a process that waits, see `frozen`."""

    def __init__(self, line: socket.socket) -> None:
        self._line = line

    def thawed(self, timeout_s: float) -> socket.socket:
        """Return the channel to a fresh copy that continues. Raises OSError."""
        self._line.settimeout(timeout_s)
        self._line.sendall(ASKED)
        said, channels, _, _ = socket.recv_fds(self._line, 1, 1)
        if said != ASKED or not channels:
            raise ConnectionError("ended")
        return socket.socket(fileno=channels[0])

    def close(self) -> None:
        """Let it end."""
        self._line.close()


def plain(error: Exception) -> str:
    """Return what an error says, without its number."""
    return (isinstance(error, OSError) and error.strerror) or str(error)
