"""`console metrics`: the state of running consoles for Prometheus."""

from __future__ import annotations

import asyncio
import socket
import time
from argparse import Namespace
from collections.abc import Callable, Collection, Sequence
from http import HTTPStatus
from http.client import HTTPException, parse_headers
from io import BytesIO
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from console.cli.arguments import host_port
from console.cli.library import data_of
from console.cli.output import tell
from console.cli.parser import Parser
from console.session.bounded_server import BoundedServer, send
from console.session.feed.request import LEAST_HZ
from console.site.cli.followed_machine import WAIT_S, warn_open
from console.text.catalogue import Catalogue
from drivers.simulator.hosts.control_address import is_loopback
from profiles.files import printable

if TYPE_CHECKING:
    from console.session.feed.feed_state import FeedState
    from drivers.link.address import TcpAddress

PATH = "/metrics"
NUMBERS = "*.*.*.*"  # any address in numbers, to which no page can lead a name
CLIENT_S = 5.0  # timeout for a client from its first byte to the last one that it reads
MOST_CLIENTS, LONGEST_HEAD = 16, 16_384
ENDS = (b"", b"\n", b"\r\n")  # of a head; b"": the client says no more


def add(parser: Parser, text: Catalogue) -> None:
    """Add the address, and further names of this computer."""
    where = text("help.metrics_listen")
    parser.add_argument("--listen", metavar="HOST:PORT", type=host_port, required=True, help=where)
    parser.add_argument("--host", metavar="NAME", action="append", default=[], help=text("help.metrics_host"))


def main(options: Namespace, text: Catalogue) -> int:
    """Answer each request with the newest states, until the user ends it; LinkError `link.cannot_listen`."""
    from console.session.feed.following import Follower, ReceivedState

    heard: list[ReceivedState] = []
    hosts = {name.lower() for name in (options.listen.host, *options.host)}
    if not is_loopback(options.listen.host):
        hosts |= {socket.gethostname().lower(), socket.getfqdn().lower(), NUMBERS}

    def answer(head: bytes) -> bytes:
        return response(head, hosts, [each.age_state(time.monotonic()) for each in heard], text)

    server = _server(options.listen, answer)
    follower = Follower(data_of(options), LEAST_HZ, lambda _: True, lambda problem: tell([problem], text))
    try:
        heard = follower.settle()
        bound = server.start(options.listen).partition(":tcp:")[2]
        warn_open(options.listen.host, bound, text)
        print(text("metrics.listening", address=f"http://{bound}{PATH}"), flush=True)
        while True:
            follower.wait(WAIT_S)
            heard = follower.newest_states()
    except KeyboardInterrupt:  # the usual way to end it
        return 0
    finally:
        server.close()
        follower.close()


def response(head: bytes, hosts: Collection[str], states: Sequence[FeedState], text: Catalogue) -> bytes:
    """Return the answer to the head of a request; `hosts` are further names of this computer, in lower case.

    A page in a browser here may have a name of its own lead to this address; the browser then sends that name.
    """
    from console.site.exchange.metrics import CONTENT_TYPE, exposition

    request, _, fields = head.partition(b"\n")
    method, target = [*request.decode("latin-1").split(), "", ""][:2]
    try:
        host = urlsplit("//" + ",".join(parse_headers(BytesIO(fields)).get_all("Host", []))).hostname or ""
    except (HTTPException, ValueError):
        host = ""
    in_numbers = ":" in host or host.replace(".", "").isdigit()
    if not (is_loopback(host) or host in hosts or (NUMBERS in hosts and in_numbers)):
        told = text("metrics.host", host=printable(host, 60) or "-", hosts=", ".join(sorted(hosts)))
        status, body = HTTPStatus.MISDIRECTED_REQUEST, f"{told}\n"
    elif (method, target.partition("?")[0]) != ("GET", PATH):
        status, body = HTTPStatus.NOT_FOUND, f"GET {PATH}\n"
    else:
        status, body = HTTPStatus.OK, exposition(states)
    content = body.encode("utf-8", "replace")
    facts = f"Content-Type: {CONTENT_TYPE}\r\nContent-Length: {len(content)}\r\nConnection: close"
    return f"HTTP/1.1 {status.value} {status.phrase}\r\n{facts}\r\n\r\n".encode("ascii") + content


def _server(address: TcpAddress, answer: Callable[[bytes], bytes]) -> BoundedServer:
    from drivers.simulator.hosts.control_socket import listen_for_control

    async def converse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with asyncio.timeout(CLIENT_S):
            head, line = b"", await reader.readline()
            while line not in ENDS and len(head) <= LONGEST_HEAD:
                head += line
                line = await reader.readline()
            await send(writer, answer(head), CLIENT_S)
            writer.close()
            await writer.wait_closed()

    return BoundedServer(
        "metrics",
        lambda made, opened: listen_for_control(made, address, opened),
        converse,
        most_clients=MOST_CLIENTS,
        longest_line=LONGEST_HEAD,
        unread_bytes=0,
    )
