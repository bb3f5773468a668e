"""`console fault`: request a fault from a served simulator, or query its faults."""

from __future__ import annotations

import json
import shlex
import socket
import sys
from argparse import Namespace
from contextlib import closing
from typing import TYPE_CHECKING

from console.cli.arguments import control_address
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from drivers.simulator.hosts.control_address import ControlAddress

DONE, FAILED, WRONG_USAGE = 0, 1, 2
TIMEOUT_S = 5.0
CHUNK = 65_536


def add(parser: Parser, text: Catalogue) -> None:
    """Add the simulator's address, and the request."""
    parser.add_argument("address", metavar="ADDRESS", type=control_address, help=text("help.fault_address"))
    parser.add_argument("words", metavar="WORD", nargs="+", help=text("help.fault_words"))


def main(options: Namespace, text: Catalogue) -> int:
    """Send one line and print the reply; 1 when it is refused."""
    from drivers.simulator.hosts.control_address import REFUSED

    if any("\n" in word for word in options.words):
        print(f"console fault: {text('usage.line_feed')}", file=sys.stderr)
        return WRONG_USAGE
    *lines, last = _answer(options.address, shlex.join(options.words))
    refused = last.startswith(REFUSED)
    if options.json:
        reason = last.removeprefix(REFUSED) if refused else None
        print(json.dumps({"answer": lines, "refused": reason, "simulated": True}, indent=2))
    for line in () if options.json else lines:
        print(line)
    if refused:
        print(f"console: {text('fault.refused', value=last.removeprefix(REFUSED))}", file=sys.stderr)
    return FAILED if refused else DONE


def _answer(address: ControlAddress, line: str) -> list[str]:
    """Return the lines of the reply, the verdict last."""
    from drivers.errors import LinkError
    from profiles.problem import Problem

    try:
        with closing(_connected(address)) as link:
            link.sendall(line.encode("utf-8") + b"\n")
            link.shutdown(socket.SHUT_WR)
            said = b"".join(iter(lambda: link.recv(CHUNK), b""))
    except ConnectionRefusedError as error:
        raise LinkError(Problem(code="link.refused", where=str(address), value=_reason(error))) from error
    except TimeoutError as error:
        raise LinkError(Problem(code="link.no_answer", where=str(address), value=_reason(error))) from error
    except OSError as error:
        raise LinkError(Problem(code="link.failed", where=str(address), value=_reason(error))) from error
    if not said.endswith(b"\n"):
        raise LinkError(Problem(code="link.lost", where=str(address), value="EOF"))
    return said.decode("utf-8", "replace").splitlines()


def _connected(address: ControlAddress) -> socket.socket:
    from drivers.link.address import TcpAddress

    if isinstance(address, TcpAddress):
        return socket.create_connection((address.host, address.port), timeout=TIMEOUT_S)
    link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        link.settimeout(TIMEOUT_S)
        link.connect(address.path)
    except OSError:
        link.close()
        raise
    return link


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
