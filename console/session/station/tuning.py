"""Commands of the page Tune, in the link thread: read the loop of the tool as the controller has it."""

from __future__ import annotations

from console.session.errors import SessionError
from console.session.station import commands
from console.session.station.context import StationContext
from drivers.identification.tool_loop import read_tool_loop
from drivers.pmac.client import PmacClient
from profiles.problem import Problem


def read_loop(context: StationContext, _: commands.ReadLoop) -> None:
    """Read gains and servo period of the tool. Nothing moves, nothing is written."""
    client = _client(context)
    motor = context.loaded_machine.machine.tool.motor
    context.tell(tool_loop=read_tool_loop(client, client.dialect, motor, context.local_time()))


def _client(context: StationContext) -> PmacClient:
    if context.client is None:
        raise SessionError(Problem(code="session.lost"))
    return context.client
