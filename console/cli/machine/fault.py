"""`console fault`: request a fault from a served simulator, or query its faults."""

from __future__ import annotations

import shlex
import socket
import sys
from argparse import Namespace
from contextlib import closing

from console.cli.arguments import WRONG_USAGE, control_address
from console.cli.output import print_json
from console.cli.parser import Parser
from console.text.catalogue import Catalogue
from drivers.errors import LinkError
from drivers.simulator.hosts.control_address import REFUSED, ControlAddress, connect_control, unreachable
from profiles.problem import Problem

TIMEOUT_S = 5.0
CHUNK = 65_536


def add(parser: Parser, text: Catalogue) -> None:
    """Add the simulator's address, and the request."""
    parser.add_argument("address", metavar="ADDRESS", type=control_address, help=text("help.fault_address"))
    parser.add_argument("words", metavar="WORD", nargs="+", help=text("help.fault_words"))


def main(options: Namespace, text: Catalogue) -> int:
    """Send one line and print the reply; 1 when it is refused."""
    if any("\n" in word for word in options.words):
        print(f"console fault: {text('usage.line_feed')}", file=sys.stderr)
        return WRONG_USAGE
    *lines, last = _answer(options.address, shlex.join(options.words))
    reason = last.removeprefix(REFUSED) if last.startswith(REFUSED) else None
    if options.json:
        print_json({"answer": lines, "refused": reason, "simulated": True})
    else:
        print("".join(f"{line}\n" for line in lines), end="")
    if reason is not None:
        print(f"console: {text('fault.refused', value=reason)}", file=sys.stderr)
    return 0 if reason is None else 1


def _answer(address: ControlAddress, line: str) -> list[str]:
    """Return the lines of the reply, the verdict last."""
    try:
        with closing(connect_control(address, TIMEOUT_S)) as link:
            link.sendall(line.encode("utf-8") + b"\n")
            link.shutdown(socket.SHUT_WR)
            reply = b"".join(iter(lambda: link.recv(CHUNK), b""))
    except OSError as error:
        raise unreachable(address, error) from error
    if not reply.endswith(b"\n"):
        raise LinkError(Problem(code="link.lost", where=str(address), value="EOF"))
    return reply.decode("utf-8", "replace").splitlines()
