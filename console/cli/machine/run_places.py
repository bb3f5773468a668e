"""Where `console run` cuts: on a machine behind a link, or on a simulated one in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from console.cli.machine.run_request import RunRequest
from console.cli.machine.stopping import Stopping
from console.session.cut.engine import CutContext
from console.session.cut.in_process import simulated_context
from console.session.cut.run import RunResult, TellPart, run, run_once
from console.session.errors import SessionError
from console.session.learning.learning import LearnResult, learn
from console.session.signals import Interruption
from console.session.station.reaching import Commissioned, Reached, guard, leave, machine_context, reach
from console.text.catalogue import Catalogue
from drivers.link.address import LinkAddress
from drivers.link.tracing import Tracing
from profiles.problem import Problem


def cut_learning(
    request: RunRequest, parts: int, interruption: Interruption, tracing: Tracing, tell: TellPart
) -> LearnResult:
    """Cut a series of parts on one simulated machine, each corrected by the ones before.

    Raises:
        ProblemError: a refusal, or what ended a cut; the machine is at rest.
    """
    return learn(request.plan, _simulated(request, interruption, tracing), tell, parts)


def cut(
    request: RunRequest, data: Path, interruption: Interruption, tracing: Tracing, tell: TellPart, text: Catalogue
) -> RunResult:
    """Cut the requested job at the requested place.

    Raises:
        ProblemError: a refusal, or what ended the cut; the machine is at rest.
    """
    if request.address is None:
        return run(request.plan, _simulated(request, interruption, tracing), tell)
    return _run_there(request, request.address, data, interruption, tracing, tell, text)


def _run_there(
    request: RunRequest,
    address: LinkAddress,
    data: Path,
    interruption: Interruption,
    tracing: Tracing,
    tell: TellPart,
    text: Catalogue,
) -> RunResult:
    """Cut one part on a machine behind a link; print on stderr how to stop it; leave its drives off."""
    stopping = Stopping(interruption, text)
    reached = reach(request.machine, address, data, tracing, stopping.seen)
    try:
        guard(interruption, reached.lathe, reached.clock.now_s)
        with stopping.watching(reached.stop):
            return _cut_there(request, reached, data, tell)
    finally:
        reached.close()


def _cut_there(request: RunRequest, reached: Reached, data: Path, tell: TellPart) -> RunResult:
    try:
        commissioned = Commissioned(
            reached.client, reached.heartbeat, request.machine.machine, data, simulated=reached.simulated
        )
        result = run_once(request.plan, machine_context(reached, commissioned), tell)
        if not leave(reached.lathe, reached.owning):
            raise SessionError(Problem(code="machine.state_unknown"))
        return result
    except BaseException:
        leave(reached.lathe, reached.owning)
        raise


def _simulated(request: RunRequest, interruption: Interruption, tracing: Tracing) -> Callable[[], CutContext]:
    """Return a function that opens a new simulated machine for each part."""

    def open_machine() -> CutContext:
        context, _ = simulated_context(request.machine.machine, request.true, tracing)
        interruption.guard(context.lathe.stop)
        return context

    return open_machine
