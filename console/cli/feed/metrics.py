"""`console metrics`: the state of running consoles for Prometheus, on a port of this computer alone."""

from __future__ import annotations

import sys
from argparse import Namespace
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.cli.arguments import problems_as_usage
from console.cli.library import data_of
from console.cli.parser import Parser
from console.session.errors import SessionError
from console.session.feed.client import readers
from console.session.feed.metrics import CONTENT_TYPE, exposition
from console.session.feed.request import MOST_HZ
from console.text.catalogue import Catalogue
from drivers.errors import LinkError
from profiles.problem import Problem

if TYPE_CHECKING:
    from drivers.link.address import TcpAddress

PATH = "/metrics"
CLIENT_S = 5.0  # timeout for a client that sends no request, or does not read


def add(parser: Parser, text: Catalogue) -> None:
    """Add the address."""
    where = text("help.metrics_listen")
    parser.add_argument("--listen", metavar="HOST:PORT", type=_address, required=True, help=where)


def main(options: Namespace, text: Catalogue) -> int:
    """Answer each request with the newest states, until the user ends it; LinkError `link.cannot_listen`."""
    address, data = options.listen, data_of(options)
    try:
        server = HTTPServer((address.host, address.port), _handler(data))
    except OSError as error:
        value = error.strerror or str(error)
        raise LinkError(Problem(code="link.cannot_listen", where=str(address), value=value)) from error
    with server:
        host, port = server.server_address[:2]
        try:
            print(text("metrics.listening", address=f"http://{host!s}:{port}{PATH}"))
            sys.stdout.flush()
            server.serve_forever()
        except KeyboardInterrupt:  # the usual way to end it
            return 0
    return 0


def states(data: Path) -> list[dict[str, Any]]:
    """Return the newest state of each running console. Raises SessionError: a feed is closed to this account."""
    try:
        found = readers(data, MOST_HZ)
    except SessionError as error:
        if error.problems[0].code == "feed.none":
            return []
        raise
    for reader in found:
        reader.close()
    return [reader.last for reader in found]


def _handler(data: Path) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        timeout = CLIENT_S

        def do_GET(self) -> None:
            """Answer a request; the name is that which http.server calls."""
            if self.path.partition("?")[0] != PATH:
                self._answer(404, f"{PATH}\n")
                return
            try:
                self._answer(200, exposition(states(data)))
            except SessionError as error:
                self._answer(503, f"{error}\n")

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing of each request."""

        def _answer(self, status: int, body: str) -> None:
            content = body.encode("utf-8", "replace")
            self.send_response(status)
            self.send_header("Content-Type", CONTENT_TYPE)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

    return Handler


def _address(word: str) -> TcpAddress:
    from drivers.link.address import TcpAddress
    from drivers.simulator.hosts.control_address import parse_control_address

    with problems_as_usage():
        address = parse_control_address(f"tcp:{word}")
    assert isinstance(address, TcpAddress)
    return address
