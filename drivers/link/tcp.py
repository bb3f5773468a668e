"""A link over TCP that carries the controller's ASCII stream as it is."""

from __future__ import annotations

import select
import socket
import threading

from drivers.errors import LinkError
from drivers.link.address import TcpAddress
from profiles.problem import Problem

CONNECT_TIMEOUT_S = 5.0
SEND_TIMEOUT_S = 2.0
CHUNK = 65_536


class TcpLink:
    """One connected socket."""

    def __init__(self, address: TcpAddress) -> None:
        """Connect.

        Raises:
            LinkError: `link.unknown_host`, `link.refused`, `link.no_answer` or `link.failed`.
        """
        self.address = str(address)
        self._sending = threading.Lock()
        try:
            self._socket = socket.create_connection((address.host, address.port), CONNECT_TIMEOUT_S)
        except socket.gaierror as error:
            raise self._error("link.unknown_host", error) from error
        except ConnectionRefusedError as error:
            raise self._error("link.refused", error) from error
        except TimeoutError as error:
            raise self._error("link.no_answer", error) from error
        except OSError as error:
            raise self._error("link.failed", error) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(SEND_TIMEOUT_S)

    def send(self, data: bytes) -> None:
        """Send bytes in order.

        Raises:
            LinkError: `link.lost`.
        """
        try:
            with self._sending:
                self._socket.sendall(data)
        except OSError as error:
            raise self._error("link.lost", error) from error

    def send_urgent(self, data: bytes) -> None:
        """Send now. A line that another thread is sending goes first: it is short, and TCP keeps the order.

        A signal handler may have interrupted that very send, so the wait for it is bounded.
        """
        held = self._sending.acquire(timeout=0.05)
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise self._error("link.lost", error) from error
        finally:
            if held:
                self._sending.release()

    def receive(self, timeout_s: float) -> bytes:
        """Return what has come within `timeout_s`.

        Raises:
            LinkError: `link.lost`.
        """
        try:
            readable, _, _ = select.select([self._socket], [], [], max(timeout_s, 0.0))
            if not readable:
                return b""
            data = self._socket.recv(CHUNK)
        except (OSError, ValueError) as error:
            raise self._error("link.lost", error) from error
        if not data:
            raise self._error("link.lost", "closed by the controller")
        return data

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _error(self, code: str, detail: object) -> LinkError:
        return LinkError(Problem(code=code, where=self.address, value=str(detail)))
