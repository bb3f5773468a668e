"""Commands of the page Tune, in the link thread: read the loop of the tool, test it, identify it.

A test is the same as that of `console health` and `console identify`, with drives that are enabled and homed
already.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from console.session.data import health, identified
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError, refuse
from console.session.station import commands, jogging
from console.session.station.context import StationContext
from drivers.identification.health import HealthRequest, check_health
from drivers.identification.identify import identify, origin_of
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import Origin
from drivers.identification.rig import Rig
from drivers.identification.tool_loop import read_tool_loop
from drivers.lathe.safety import safety_problems
from drivers.pmac.client import PmacClient
from profiles.problem import Problem, ProfileError


def read_loop(context: StationContext, _: commands.ReadLoop) -> None:
    """Read gains and servo period of the tool. Nothing moves, nothing is written."""
    client = _client(context)
    motor = context.loaded_machine.machine.tool.motor
    context.tell(tool_loop=read_tool_loop(client, client.dialect, motor, context.local_time()))


def check_tool(context: StationContext, command: commands.CheckHealth) -> None:
    """Test the tool at its zero, and keep the result."""
    request = HealthRequest(step_um=command.step_um)

    def work(rig: Rig, origin: Origin) -> Path:
        return health.store(context.records, check_health(rig, request, origin, utc_now()))

    _tested(context, work)


def identify_tool(context: StationContext, command: commands.IdentifyTool) -> None:
    """Identify the tool on one path, and keep its response."""
    request = IdentificationRequest(path=command.path)

    def work(rig: Rig, origin: Origin) -> Path:
        return identified.store(context.records, identify(rig, request, origin, utc_now()))

    _tested(context, work)


def _tested(context: StationContext, work: Callable[[Rig, Origin], Path]) -> None:
    """Refuse what must not be, work, and tell the file."""
    client, lathe = _client(context), context.lathe
    snapshot, machine = lathe.snapshot(), context.loaded_machine.machine
    if not context.state.simulated:
        refuse(safety_problems(machine, snapshot.inputs))
    if jogging.tool_in_part(snapshot, machine, context.state.alignment):
        raise SessionError(Problem(code="machine.tool_in_part"))
    _load_numerics()
    rig, (version, kind) = Rig(client=client, lathe=lathe, clock=context.clock), context.state.firmware
    with _profile_errors_refuse():
        origin = origin_of(rig, version=version, kind=kind, simulated=context.state.simulated)
        context.tell(tested=work(rig, origin).name)


@contextmanager
def _profile_errors_refuse() -> Iterator[None]:
    """Data that cannot be evaluated or kept are no reason to stop: where the tool moved it has been stopped."""
    try:
        yield
    except ProfileError as error:
        raise SessionError(*error.problems) from error


def _load_numerics() -> None:
    """Load what evaluates the samples while nothing moves yet: its import holds up this thread."""
    import scipy.signal
    import scipy.stats  # noqa: F401


def _client(context: StationContext) -> PmacClient:
    if context.client is None:
        raise SessionError(Problem(code="session.lost"))
    return context.client
