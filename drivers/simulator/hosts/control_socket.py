"""The control socket of a served simulator: text lines for faults, and an operator's actions at the lathe.

A reply is some lines, the last of which is `ok` or `refused: ...`. A fault is injected by a line such as
`inject late-reply after=1.5 for=0.2 delay_ms=300 seed=3`.
"""

from __future__ import annotations

import asyncio
import errno
import math
import os
import shlex
import socket
import stat
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress

from drivers.errors import RefusedError
from drivers.link.address import TcpAddress
from drivers.simulator.faults.board import FaultBoard, InjectedFault, inject_words
from drivers.simulator.faults.catalogue import CATALOGUE, Value, find, refusal
from drivers.simulator.hosts.connection import TurnScheduler
from drivers.simulator.hosts.control_address import LONGEST_LINE, OK, PREFIX, REFUSED, ControlAddress, UnixAddress
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.collision import Collision

LINES_A_TURN = 4  # maximum lines that are answered in one go; in between, the machine and its hosts have a turn
UNREAD_LIMIT = 65_536  # maximum reply bytes that wait for a client; beyond that, its input is not read
OWNER_ONLY = 0o600
SERVED_WITHIN_S = 1.0  # timeout to find out whether a path is still served
_FAULT_WORDS = ("list", "help NAME", "inject NAME [KEY=VALUE ...]", "active", "clear")
WORDS = (*_FAULT_WORDS, "power-cycle", "spindle RPM", "spindle off", "collisions")


def answer(lathe: SimulatedLathe, line: str) -> str:
    """Execute a line; return the text to report, lines with an end each."""
    try:
        said = [*_obey(lathe, line), OK]
    except RefusedError as error:
        problem = error.problems[0]
        fault = f"{problem.where}: " if problem.where not in ("", problem.value) else ""
        remedy = f"help {problem.where}" if problem.where in CATALOGUE else "list"
        said = [
            f"{REFUSED}{fault}{problem.key} '{problem.value}' is not possible;"
            f" allowed: {problem.limit}; `{remedy}` tells more"
        ]
    except _CannotBeDoneError as error:
        said = [f"{REFUSED}{error}"]
    return "".join(f"{item}\n" for item in said)


class _CannotBeDoneError(Exception):
    """The lathe has no such device, at any value."""


def _obey(lathe: SimulatedLathe, line: str) -> list[str]:  # noqa: C901 - one branch a case
    if len(line.encode("utf-8", "replace")) > LONGEST_LINE:
        raise _CannotBeDoneError(f"a line has at most {LONGEST_LINE} bytes")
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise _no_command(f"{line} ({error})") from error
    match words:
        case ["list"]:
            return [f"{fault.name}: {fault.does}" for fault in CATALOGUE.values()]
        case ["help", name]:
            return list(_help(name))
        case ["inject", name, *settings]:
            injected = inject_words(lathe.faults, name, settings)
            return [said for said in (_describe_fault(injected, lathe.now_s()), injected.effect.outcome()) if said]
        case ["active"]:
            active = [_describe_fault(injected, lathe.now_s()) for injected in lathe.faults.active()]
            return [*active, *_shut_down(lathe.faults)]
        case ["clear"]:
            lathe.faults.clear()
            return _shut_down(lathe.faults)
        case ["power-cycle"]:
            lathe.power_cycle()
        case ["spindle", value]:
            _turn_spindle(lathe, value)
        case ["collisions"]:
            return [_seen(collision) for collision in lathe.collisions]
        case _:
            raise _no_command(line)
    return []


def _no_command(line: str) -> RefusedError:
    return refusal("", "command", _escape_line(line.strip())[:80], " | ".join(WORDS))


def _help(name: str) -> Iterator[str]:
    fault = find(name)
    yield f"{fault.name}: {fault.does} It concerns {fault.concerns}."
    for parameter in (*fault.parameters, *fault.times):
        unit = f" ({parameter.unit})" if parameter.unit else ""
        default = "" if parameter.default is None else f"; default {_plain(parameter.default)}"
        yield f"  {parameter.name}{unit}: {parameter.meaning}; {parameter.range_text}{default}"


def _shut_down(board: FaultBoard) -> list[str]:
    """State that the end of the fault does not repair its effect."""
    if board.shut_down_s is None:
        return []
    return [f"card shut down by its watchdog at {board.shut_down_s:.3f} s; power-cycle"]


def _describe_fault(injected: InjectedFault, now_s: float) -> str:
    state = " (waits)" if injected.begins_s > now_s else ""
    values = "".join(f" {key}={shlex.quote(_plain(value))}" for key, value in injected.values.items())
    end = "until it is cleared" if math.isinf(injected.ends_s) else f"to {injected.ends_s:.3f} s"
    when = f"at {injected.begins_s:.3f} s" if injected.fault.moment else f"from {injected.begins_s:.3f} s {end}"
    return f"{injected.fault.name}{values} seed={injected.seed}, {when}{state}"


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else value


def _turn_spindle(lathe: SimulatedLathe, value: str) -> None:
    """Set the spindle as at its inverter: a speed, positive in the direction of the cut, or off."""
    try:
        lathe.set_spindle(None if value == "off" else float(value))
    except ValueError as error:
        raise _CannotBeDoneError(f"spindle '{_escape_line(value)}' is not possible; allowed: RPM | off") from error
    except RuntimeError as error:
        raise _CannotBeDoneError(f"spindle '{_escape_line(value)}' is not possible; {error}") from error


def _seen(collision: Collision) -> str:
    angle_deg = round(collision.angle_deg, 2) % 360.0
    where = f"radius {collision.radius_mm:.3f} mm, Z {collision.z_mm:.3f} mm, {angle_deg:.2f} deg"
    return f"{collision.kind}: {where}, at {collision.time_ms:.1f} ms"


def _escape_line(text: str) -> str:
    return ascii(text)[1:-1]


class ControlHost(asyncio.Protocol):
    """One client of the control socket."""

    def __init__(self, lathe: SimulatedLathe) -> None:
        self._lathe = lathe
        self._received = bytearray()
        self._ended = self._full = False
        self._turns = TurnScheduler(self._turn)
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport for replies."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.set_write_buffer_limits(high=UNREAD_LIMIT)

    def connection_lost(self, exc: Exception | None) -> None:
        """Discard the input of a client that has disconnected."""
        self._turns.end()

    def data_received(self, data: bytes) -> None:
        """Answer each complete line; drop a client that sends one without an end."""
        self._received += data
        self._turns.take()

    def eof_received(self) -> bool:
        """Accept a last line without its end. The connection is closed after the replies."""
        if self._received.rpartition(b"\n")[2].strip():
            self._received += b"\n"
        self._ended = True
        self._turns.take()
        return True

    def pause_writing(self) -> None:
        """Stop while the client does not read."""
        self._full = True

    def resume_writing(self) -> None:
        """Resume when it reads again."""
        self._full = False
        self._turns.take()

    def _turn(self) -> bool:
        """Answer the next few lines; return whether there are more that can be answered."""
        for _ in range(LINES_A_TURN):
            end = self._received.find(b"\n")
            if end < 0 or self._full:
                break
            line = bytes(self._received[: min(end, LONGEST_LINE + 1)])
            del self._received[: end + 1]
            self._transport.write(answer(self._lathe, line.decode("utf-8", "replace")).encode("utf-8", "replace"))
        more = b"\n" in self._received
        if more or self._full:
            if not self._ended:
                self._transport.pause_reading()
        elif self._ended:
            self._transport.close()
        elif len(self._received) > LONGEST_LINE:
            self._transport.abort()
        else:
            self._transport.resume_reading()
        return more and not self._full


async def listen_for_control(
    made: Callable[[], asyncio.Protocol], address: ControlAddress, opened: ExitStack
) -> tuple[asyncio.Server, str]:
    """Listen; return the server, and the address that was bound. `opened` closes it and removes its file.

    `made` makes what serves one client.

    Raises OSError: it cannot be done; also where the path is taken by anything but a socket that nobody serves.
    """
    loop = asyncio.get_running_loop()
    if isinstance(address, TcpAddress):
        server = await loop.create_server(made, address.host, address.port)
        opened.callback(server.close)
        host, port = server.sockets[0].getsockname()[:2]
        return server, f"{PREFIX}{TcpAddress(host=host, port=port)}"
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as listening:
        _bind(listening, address)
        opened.callback(_remove, address.path, os.stat(address.path).st_ino)
        server = await loop.create_unix_server(made, sock=listening.dup())
    opened.callback(server.close)
    return server, f"{PREFIX}{address}"


def _bind(listening: socket.socket, address: UnixAddress) -> None:
    """Bind the path; one left by a dead process is reused."""
    with suppress(FileNotFoundError):
        if stat.S_ISSOCK(os.lstat(address.path).st_mode) and not _is_served(address.path):
            os.unlink(address.path)
    before = os.umask(0o777 & ~OWNER_ONLY)
    try:
        listening.bind(address.path)
    finally:
        os.umask(before)


def _is_served(path: str) -> bool:
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as probe:
        probe.settimeout(SERVED_WITHIN_S)
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            return False
        except OSError as error:
            if error.errno != errno.EAGAIN and not isinstance(error, TimeoutError):
                raise
        return True  # also when the backlog is full


def _remove(path: str, inode: int) -> None:
    """Remove our socket, but not another one that has since taken its path."""
    with suppress(OSError):
        if os.lstat(path).st_ino == inode:
            os.unlink(path)
