"""`python -m drivers.simulator`: the simulated lathe as a process of its own, in real time, on a pseudo-terminal.

`drivers.simulator.hosts.process` starts it. It lives as long as the channel to it: when the channel closes for any
reason, or a signal asks for it, the process ends and cleans up.
"""

from __future__ import annotations

import argparse
import asyncio
import socket
import time
from dataclasses import replace
from functools import partial

from drivers.placed import placed_of
from drivers.simulator.hosts.channel import converse
from drivers.simulator.hosts.pty import PtyHost
from drivers.simulator.hosts.real_time import Ending, Pace, keep_time, patient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import begun_at
from drivers.simulator.plant.which_lathe import MOUNTED
from profiles.store import load_machine


def main() -> None:
    """Read the command line and serve."""
    parser = argparse.ArgumentParser(prog="python -m drivers.simulator", description="The simulated lathe.")
    parser.add_argument("--channel", type=_channel, required=True, metavar="FD", help="inherited stream socket")
    parser.add_argument("--machine", required=True, metavar="PATH", help="machine profile")
    parser.add_argument("--seed", type=int, metavar="N", help="mount chuck and tool the same way each time")
    parser.add_argument("--plant", default=MOUNTED, metavar="NAME", help="how the lathe really is")
    parser.add_argument("--clamping-sd", type=float, metavar="PERCENT", help="of the chucking force")
    parser.add_argument("--blind", action="store_true", help="show dials instead of the truth")
    parser.add_argument("--placed", type=placed_of, metavar="JSON", help="where it begins, instead of power-up")
    parser.add_argument("--parts-before", type=int, default=0, metavar="N", help="clamped on it already")
    options = parser.parse_args()
    machine = load_machine(options.machine).machine
    true = plant_named(options.plant, machine, options.seed, options.clamping_sd, mounted_by_hand=True)
    placed, true = options.placed, replace(true, parts_before=options.parts_before)
    true = true if placed is None else begun_at(true, placed)
    lathe = SimulatedLathe(machine, true, blind=options.blind)
    if placed is not None:
        lathe.take_over(placed)
    asyncio.run(_serve(lathe, options.channel, Pace()))


def _go_on(lathe: SimulatedLathe, channel: socket.socket) -> None:
    """Serve a copy of the lathe, from its checkpoint on: its time stands still until it is told to continue."""
    lathe.disconnect_all()
    asyncio.run(_serve(lathe, channel, Pace(0.0)))


async def _serve(lathe: SimulatedLathe, channel: socket.socket, pace: Pace) -> None:
    ended = Ending()
    reader, writer = await asyncio.open_connection(sock=channel)
    host = PtyHost(lathe)

    def heard_s() -> float | None:
        """Return when the host was heard last; in a pause it may be silent."""
        return None if lathe.lines.cut or host.heard_s is None else max(host.heard_s, pace.changed_s)

    try:
        advance = patient(lathe.wait, heard_s, time.monotonic, pace)
        talk = converse(lathe, host.device, reader, writer, pace, partial(_go_on, lathe))
        await keep_time(advance, (host,), ended.wait(), talk, pace=pace)
    finally:
        host.close()
        writer.transport.abort()


def _channel(word: str) -> socket.socket:
    """Adopt an inherited socket; argparse reports a `ValueError` in one line."""
    try:
        return socket.socket(fileno=int(word))
    except OSError as error:
        raise ValueError(word) from error


if __name__ == "__main__":
    main()
