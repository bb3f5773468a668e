"""How many commands a second the simulated card answers, and how late its clock is while it does.

The baseline of the rates is a bare asyncio server that sends back what it gets, in a process of its own like the
simulator. "One in flight" waits for each reply; "pipelined" sends a hundred lines at a time.

    python -m benchmarks.command_rate
"""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import re
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import numpy as np

from benchmarks.measure import extent, print_table, seconds
from drivers.simulator.hosts.connection import HostConnection, PlainStream
from drivers.simulator.hosts.real_time import Host, keep_time
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine

MACHINE = "lee-2001-lathe"
LINE = b"#1P"
COMMANDS = extent(2000, 200)
BATCH = 100
RUNS = extent(9, 1)
AIM = 1.0 / 3.0

CLOCK_S = extent(10.0, 0.5)
CLIENTS = 4
POLL_HZ = 100.0
LOOK = b"#1PVF#2PVF#3PVF&1??\r"
RANGE = b"I0..1023\r"

ECHO = """
import asyncio

class Echo(asyncio.Protocol):
    def connection_made(self, transport):
        self.transport = transport

    def data_received(self, data):
        self.transport.write(data)

async def main():
    server = await asyncio.get_running_loop().create_server(Echo, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()

asyncio.run(main())
"""


@dataclass(frozen=True, slots=True)
class Server:
    """Where a server is connected, what it is sent for one command and what ends its reply."""

    host: socket.socket
    request: bytes
    end: bytes

    def ask(self, requests: int) -> None:
        """Send requests at once and wait for all replies.

        Raises:
            RuntimeError: there were more replies than requests, so that the rate means nothing.
        """
        self.host.sendall(self.request * requests)
        while requests > 0:
            requests -= self.host.recv(65_536).count(self.end)
        if requests:
            raise RuntimeError("a reply too many")

    def rate(self, batch: int) -> float:
        """Return commands a second."""

        def work() -> None:
            for _ in range(COMMANDS // batch):
                self.ask(batch)

        return COMMANDS / seconds(work)


def get_response(line: bytes) -> bytes:
    """Return the request of the Ethernet board for a line."""
    return struct.pack(">BBHHH", 0x40, 0xBF, 0, 0, len(line)) + line


@contextmanager
def running(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run Python with its output to be read, and end it."""
    with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


def connect(port: int) -> socket.socket:
    connected = socket.create_connection(("127.0.0.1", port), timeout=10.0)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connected


def said(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def servers(stack: ExitStack) -> dict[str, Server]:
    """Start the echo and the simulator."""
    echo = stack.enter_context(running("-c", ECHO))
    listeners = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0")
    simulator = stack.enter_context(running("-m", "console", "simulator", "--json", *listeners))
    ports = [int(re.sub(".*:", "", json.loads(said(simulator))["listening"])) for _ in range(2)]
    hosts = [stack.enter_context(connect(port)) for port in (int(said(echo)), *ports)]
    line = LINE + b"\r"
    found = {
        "echo": Server(hosts[0], line, b"\r"),
        "tcp": Server(hosts[1], line, b"\x06"),
        "ethernet": Server(hosts[2], get_response(LINE), b"\x06"),
    }
    Server(hosts[1], b"I3=2 I6=1\r", b"\x06").ask(1)
    return found


def rates() -> list[tuple[str, float, float]]:
    """Return a name, commands a second and their share of the echo, for each row."""
    kinds = (("one in flight", 1, ("echo", "tcp", "ethernet")), ("pipelined", BATCH, ("echo", "tcp")))
    rows = []
    with ExitStack() as stack:
        reached = servers(stack)
        for way, batch, names in kinds:
            measured: dict[str, list[float]] = {name: [] for name in names}
            for run in range(RUNS + 1):
                for name in names:
                    rate = reached[name].rate(batch)
                    if run:  # the first one warms up
                        measured[name].append(rate)
            middle = {name: statistics.median(values) for name, values in measured.items()}
            rows += [(f"{way}, {name}", rate, rate / middle["echo"]) for name, rate in middle.items()]
    return rows


def poll(port: int) -> None:
    """Look at the machine at a fixed rate until the server is gone."""
    with connect(port) as host:
        due = time.monotonic()
        try:
            while True:
                host.sendall(LOOK)
                host.recv(65_536)
                due += 1.0 / POLL_HZ
                time.sleep(max(due - time.monotonic(), 0.0))
        except OSError:
            return


def flood(port: int) -> None:
    """Ask for a thousand values at a time, faster than they are answered, until the server is gone."""
    with connect(port) as host:
        host.settimeout(None)
        reading = threading.Thread(target=drain, args=(host,), daemon=True)
        reading.start()
        try:
            while True:
                host.sendall(RANGE * BATCH)
        except OSError:
            return


def drain(host: socket.socket) -> None:
    """Read whatever comes."""
    try:
        while host.recv(1 << 20):
            pass
    except OSError:
        return


def quantile_s(lags_s: list[float], fraction: float) -> float:
    """Return the least delay that a fraction of the delays do not exceed."""
    return float(np.quantile(lags_s, fraction, method="inverted_cdf"))


async def lag_of_the_timer() -> list[float]:
    """Keep the time of nothing at all; return how late the clock came."""
    lags_s: list[float] = []
    await keep_time(lambda _: None, (), asyncio.sleep(CLOCK_S), lags_s=lags_s)
    return lags_s


async def lag_of(clients: int, client: Callable[[int], None] = poll) -> list[float]:
    """Serve in this process, for clients in processes of their own; return how late the clock came."""
    lathe, lags_s = SimulatedLathe(load_machine(MACHINE).machine), list[float]()
    hosts: set[Host] = set()
    create: Callable[[], HostConnection] = lambda: HostConnection(lathe, hosts, PlainStream)  # noqa: E731
    server = await asyncio.get_running_loop().create_server(create, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    context = multiprocessing.get_context("spawn")
    polling = [context.Process(target=client, args=(port,), daemon=True) for _ in range(clients)]
    for process in polling:
        process.start()
    await keep_time(lathe.wait, hosts, connected(hosts, clients))
    await keep_time(lathe.wait, hosts, asyncio.sleep(CLOCK_S), lags_s=lags_s)
    for process in polling:
        process.terminate()
        process.join()
    server.close()
    return lags_s


async def connected(hosts: set[Host], clients: int) -> None:
    """Wait until so many are connected."""
    while len(hosts) < clients:
        await asyncio.sleep(0.01)


def main() -> None:
    """Measure and print."""
    table = [(name, f"{rate:.0f}", f"{share:.2f}") for name, rate, share in rates()]
    title = f"{LINE.decode()}, median of {RUNS} times {COMMANDS} commands; the aim is {AIM:.2f} of the echo"
    print_table(title, ("", "commands a second", "x echo"), table)
    print()
    lags = [("nothing to simulate (baseline)", asyncio.run(lag_of_the_timer()))]
    lags.append(("no clients", asyncio.run(lag_of(0))))
    lags.append((f"{CLIENTS} clients at {POLL_HZ:.0f} Hz", asyncio.run(lag_of(CLIENTS))))
    lags.append(("one host streaming ranges", asyncio.run(lag_of(1, flood))))
    baseline_s = quantile_s(lags[0][1], 0.99)
    rows = [
        (
            name,
            *(f"{1e3 * quantile_s(lags_s, fraction):.2f} ms" for fraction in (0.5, 0.99, 1.0)),
            f"{quantile_s(lags_s, 0.99) / baseline_s:.2f}",
        )
        for name, lags_s in lags
    ]
    title = f"How late the clock of the simulation is, in {CLOCK_S:.0f} s of ticks"
    print_table(title, ("", "median", "99 of 100", "worst", "x baseline"), rows)


if __name__ == "__main__":
    main()
