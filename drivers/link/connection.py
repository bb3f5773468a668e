"""One connected socket without send delay for short writes, and the reasons why connecting can fail."""

from __future__ import annotations

import errno
import select
import socket
from contextlib import suppress

from drivers.errors import LinkError
from profiles.problem import Problem

CONNECT_TIMEOUT_S = 5.0
CHUNK = 65_536

IDLE_S, PROBE_S, PROBES = 5, 2, 3  # TCP keep-alive: idle time, then probes; unanswered, it is closed
_REFUSALS = {
    errno.ECONNREFUSED: "link.refused",
    errno.ETIMEDOUT: "link.no_answer",
    errno.EHOSTUNREACH: "link.unreachable",
    errno.ENETUNREACH: "link.unreachable",
    errno.EADDRNOTAVAIL: "link.unreachable",
}


class Connection:
    """A TCP connection to a controller. `address` is the name used in error reports."""

    def __init__(self, host: str, port: int, address: str) -> None:
        """Connect.

        Raises LinkError: `link.unknown_host`, `link.refused`, `link.no_answer`, `link.unreachable`, `link.failed`.
        """
        self.address = address
        try:
            self._socket = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
        except (socket.gaierror, UnicodeError) as error:
            raise self._error("link.unknown_host", host) from error
        except TimeoutError as error:
            raise self._error("link.no_answer", f"{CONNECT_TIMEOUT_S:g} s") from error
        except OSError as error:
            raise self._error(_REFUSALS.get(error.errno or 0, "link.failed"), _reason(error)) from error
        self._socket.setblocking(False)
        for level, option, value in (
            (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),
            (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
            (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, IDLE_S),
            (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, PROBE_S),
            (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, PROBES),
        ):
            self._socket.setsockopt(level, option, value)

    def write(self, data: bytes, wait_s: float) -> None:
        """Send all, waiting at most `wait_s` at a time. Raises LinkError: `link.lost`, perhaps after a part."""
        left = memoryview(data)
        try:
            while left:
                try:
                    left = left[self._socket.send(left) :]
                except BlockingIOError:
                    _, writable, _ = select.select([], [self._socket], [], wait_s)
                    if not writable:
                        raise TimeoutError(errno.ETIMEDOUT, "nobody takes what is sent") from None
        except (OSError, ValueError) as error:
            raise self._error("link.lost", _reason(error)) from error

    def write_whole(self, frame: bytes) -> None:
        """Send all at once, or end the connection (`link.lost`): nothing may follow half a frame."""
        try:
            if self._socket.send(frame) < len(frame):
                raise BlockingIOError(errno.EAGAIN, "nobody takes what is sent")
        except OSError as error:
            # Not closed here: another thread may be about to use the file descriptor.
            with suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
            raise self._error("link.lost", _reason(error)) from error

    def receive(self, timeout_s: float = 0.0) -> bytes:
        """Return the bytes within `timeout_s`; empty on timeout. Raises LinkError: `link.lost`, `link.closed`."""
        try:
            ready, _, _ = select.select([self._socket], [], [], max(timeout_s, 0.0))
            if not ready:
                return b""
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise self._error("link.lost", _reason(error)) from error
        if not data:
            raise self._error("link.closed")
        return data

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _error(self, code: str, reason: str = "") -> LinkError:
        return LinkError(Problem(code=code, where=self.address, value=reason))


def _reason(error: OSError | ValueError) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)
