"""The private channel between the process of the simulated lathe and the one that started it.

It is a stream of JSON lines, one reply for each request: `{"do": "mount", "job": {...}}`, `{"do": "measure"}`,
`{"do": "look"}`, `{"do": "truth"}`, `{"do": "indicate", "places": 12}` (an indicator on the clamped part),
`{"do": "spindle", "rpm": 800}` (a spindle on an inverter; null disables it), `{"do": "pace", "speed": 2.0}` (0
pauses) and `{"do": "fault", "line": "..."}` (see `control_line`). The reply to
an impossible request is `{"refused": reason}`. The reply to `{"do": "checkpoint"}` comes with the line to a frozen
copy, see `frozen`.

Before any request, one line `{"ready": device, "lathe": {"plant": "steady", "seed": 7, "alike": false},
"parts_differ": true}` has the device of the controller, which lathe it is (see `WhichLathe`), and whether its
parts differ.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from drivers.simulator.hosts import control_line
from drivers.simulator.hosts.control_address import REFUSED
from drivers.simulator.hosts.frozen import GoOn, freeze
from drivers.simulator.hosts.real_time import Pace
from drivers.simulator.machine import SimulatedLathe
from profiles.job import job_from_table
from profiles.problem import ProfileError
from profiles.strict_values import from_json, positive, whole


async def converse(
    lathe: SimulatedLathe,
    device: str,
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    pace: Pace,
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


def answer(lathe: SimulatedLathe, line: bytes, pace: Pace | None = None) -> dict[str, Any]:  # noqa: C901 - one branch a case
    """Execute the request in a line; that of another pace changes `pace`."""
    try:
        request = from_json(line)
        match request["do"]:
            case "mount":
                lathe.mount(job_from_table(request["job"]))
                return {}
            case "look":
                return {**asdict(lathe.look()), "held_s": 0.0 if pace is None else pace.held_s}
            case "measure":
                trace = lathe.measure()
                columns = {"angle_deg": trace.angle_deg.tolist(), "deviation_um": trace.deviation_um.tolist()}
                return {**columns, "meta": dict(trace.meta)}
            case "indicate":
                return asdict(lathe.indicate(_places(request.get("places"))))
            case "truth":
                return asdict(lathe.truth())
            case "spindle":
                lathe.set_spindle(request["rpm"])
                return {}
            case "pace" if pace is not None:
                pace.set(positive(request["speed"]) if request["speed"] else 0.0)
                return {}
            case "fault":
                said = control_line.answer(lathe, str(request["line"]))
                refused = said.startswith(REFUSED)
                return {"refused": said.removeprefix(REFUSED).rstrip()} if refused else {"said": said}
            case unknown:
                return {"refused": f"nothing to do: {unknown}"}
    except (ProfileError, RuntimeError) as error:
        return {"refused": str(error)}
    except (ValueError, TypeError, KeyError) as error:
        return {"refused": f"no request: {error!r}"}


def _places(asked: Any) -> int | None:
    """Return a number of places; ValueError for what is none."""
    return None if asked is None else whole(asked)


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
