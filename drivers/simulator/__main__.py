"""`python -m drivers.simulator`: the simulated lathe as a process of its own, in real time, on a pseudo-terminal.

`drivers.simulator.hosts.process` starts it. It lives as long as the channel to it: when the channel closes for any
reason, or a signal asks for it, the process ends and cleans up.

The private channel is a stream of JSON lines, one reply for each request: `{"do": "mount", "job": {...}}`,
`{"do": "measure", "turned_deg": 90}` (the part turned on the gauge), `{"do": "sections"}` (of the part that was
measured), `{"do": "look"}`, `{"do": "truth"}`,
`{"do": "indicate", "places": 12}` (an indicator on the clamped part), `{"do": "spindle", "rpm": 800}` (a spindle
on an inverter; null disables it), `{"do": "pace", "speed": 2.0}` (0 pauses) and `{"do": "fault", "line": "..."}`
(see `control_socket`). The reply to an impossible request is `{"refused": reason}`. The reply to
`{"do": "checkpoint"}` comes with the line to a frozen copy (see `real_time`).

Before any request, one line `{"ready": device, "lathe": {"plant": "steady", "seed": 7, "alike": false},
"parts_differ": true}` has the device of the controller, which lathe it is (see `WhichLathe`), and whether its
parts differ.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any

from drivers.lathe_placement import placed_of
from drivers.simulator.hosts import control_socket
from drivers.simulator.hosts.control_address import REFUSED
from drivers.simulator.hosts.pty import PtyHost
from drivers.simulator.hosts.real_time import GoOn, SimulationPace, TerminationSignals, freeze, keep_time, patient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import begun_at
from drivers.simulator.plant.which_lathe import MOUNTED
from profiles.job import job_from_table
from profiles.problem import ProfileError
from profiles.store import load_machine
from profiles.strict_values import from_json, number, positive, whole_number


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
    asyncio.run(_serve(lathe, options.channel, SimulationPace()))


def _go_on(lathe: SimulatedLathe, channel: socket.socket) -> None:
    """Serve a copy of the lathe, from its checkpoint on; its time stands still until a pace is set."""
    lathe.disconnect_all()
    asyncio.run(_serve(lathe, channel, SimulationPace(0.0)))


async def converse(
    lathe: SimulatedLathe,
    device: str,
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    pace: SimulationPace,
    go_on: GoOn,
) -> None:
    """Announce the device, then answer until the other side disconnects. Copies of this process `go_on`."""
    await _say(writer, {"ready": device, "lathe": asdict(lathe.which), "parts_differ": lathe.parts_differ})
    try:
        while line := await reader.readline():
            if _is_checkpoint(line):
                _say_with_copy(writer, go_on)
            else:
                await _say(writer, answer(lathe, line, pace))
    except (ConnectionError, ValueError):
        return  # disconnected in the middle of a line, or a line without end: there is no one to reply to


def answer(lathe: SimulatedLathe, line: bytes, pace: SimulationPace | None = None) -> dict[str, Any]:
    """Execute the request in a line; that of another pace changes `pace`."""
    try:
        request = from_json(line)
        wanted = request["do"]
        act = _ANSWERS.get(wanted) if isinstance(wanted, str) else None
        if act is None:
            return {"refused": f"nothing to do: {wanted}"}
        return act(lathe, request, pace or SimulationPace()) or {}
    except (ProfileError, RuntimeError) as error:
        return {"refused": str(error)}
    except (ValueError, TypeError, KeyError) as error:
        return {"refused": f"no request: {error!r}"}


def _measure(lathe: SimulatedLathe, turned_deg: Any) -> dict[str, Any]:
    trace = lathe.measure(turned_deg=number(turned_deg))
    columns = {"angle_deg": trace.angle_deg.tolist(), "deviation_um": trace.deviation_um.tolist()}
    return {**columns, "meta": dict(trace.meta)}


def _sections(lathe: SimulatedLathe) -> dict[str, Any]:
    found = lathe.sections()
    rows = [{"z_mm": each.z_mm, "deviation_um": each.deviation_um.tolist()} for each in found]
    return {"angle_deg": found[0].angle_deg.tolist(), "sections": rows}


def _indicate(lathe: SimulatedLathe, places: Any) -> dict[str, Any]:
    return asdict(lathe.indicate(None if places is None else whole_number(places)))


def _obey_fault(lathe: SimulatedLathe, line: str) -> dict[str, Any]:
    said = control_socket.answer(lathe, line)
    refused = said.startswith(REFUSED)
    return {"refused": said.removeprefix(REFUSED).rstrip()} if refused else {"said": said}


_ANSWERS: Mapping[str, Callable[[SimulatedLathe, Mapping[str, Any], SimulationPace], dict[str, Any] | None]] = {
    "mount": lambda lathe, request, _: lathe.mount(job_from_table(request["job"])),
    "look": lambda lathe, _, pace: {**asdict(lathe.look()), "held_s": pace.held_s},
    "measure": lambda lathe, request, _: _measure(lathe, request.get("turned_deg", 0.0)),
    "sections": lambda lathe, _, __: _sections(lathe),
    "indicate": lambda lathe, request, _: _indicate(lathe, request.get("places")),
    "indicate_band": lambda lathe, request, _: asdict(lathe.indicate_band(number(request["behind_face_mm"]))),
    "truth": lambda lathe, _, __: asdict(lathe.truth()),
    "spindle": lambda lathe, request, _: lathe.set_spindle(request["rpm"]),
    "pace": lambda _, request, pace: pace.set(positive(request["speed"]) if request["speed"] else 0.0),
    "fault": lambda lathe, request, _: _obey_fault(lathe, str(request["line"])),
}
"""What each request does; None answers with nothing."""


def _is_checkpoint(line: bytes) -> bool:
    try:
        request = from_json(line)
    except ValueError:
        return False
    return isinstance(request, dict) and request.get("do") == "checkpoint"


def _say_with_copy(writer: asyncio.StreamWriter, go_on: GoOn) -> None:
    """Freeze a copy and pass the line to it on: nothing else is on its way, so there is room."""
    with socket.socket(fileno=os.dup(writer.get_extra_info("socket").fileno())) as channel:
        try:
            line = freeze(go_on)
        except OSError as error:
            channel.sendall(json.dumps({"refused": error.strerror or str(error)}).encode("ascii") + b"\n")
            return
        with line:
            socket.send_fds(channel, [b"{}\n"], [line.fileno()])


async def _say(writer: asyncio.StreamWriter, message: Mapping[str, Any]) -> None:
    writer.write(json.dumps(message).encode("ascii") + b"\n")
    await writer.drain()


async def _serve(lathe: SimulatedLathe, channel: socket.socket, pace: SimulationPace) -> None:
    ended = TerminationSignals()
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
