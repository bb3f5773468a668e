"""Where `console run` cuts: on a machine behind a link, or on a simulated one in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from console.cli.run_order import RunOrder
from console.cli.stopping import Stopping
from console.session.commissioned import Commissioned
from console.session.errors import SessionError
from console.session.learning import LearnResult, learn
from console.session.machine_run import guard, leave, machine_shop
from console.session.reaching import Reached, reach
from console.session.run import RunResult, run, run_once
from console.session.sequence import Shop, Step
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.heartbeat import Heartbeat
from drivers.lathe import Lathe
from drivers.link.address import LinkAddress
from drivers.link.memory import MemoryLink
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.stop import StopPath
from profiles.machine import MachineProfile
from profiles.problem import Problem

Tell = Callable[[str, Step, str], None]
"""Takes each step: the part, what is done to it, and a detail in words."""


def cut_learning(
    order: RunOrder, parts: int, interruption: Interruption, tracing: Tracing, tell: Tell
) -> LearnResult:
    """Cut parts in a row on one simulated machine, each with what the ones before have taught.

    Raises:
        ProblemError: a refusal, or what ended a cut; the machine is at rest.
    """
    open_shop = _simulated_shop(order.machine.machine, order.true, interruption, tracing)
    return learn(order.plan, open_shop, tell, parts)


def cut(
    order: RunOrder, data: Path, interruption: Interruption, tracing: Tracing, tell: Tell, text: Catalogue
) -> RunResult:
    """Cut what was ordered, where it was ordered.

    Raises:
        ProblemError: a refusal, or what ended the cut; the machine is at rest.
    """
    if order.address is None:
        return run(order.plan, _simulated_shop(order.machine.machine, order.true, interruption, tracing), tell)
    return _run_there(order, order.address, data, interruption, tracing, tell, text)


def _run_there(
    order: RunOrder,
    address: LinkAddress,
    data: Path,
    interruption: Interruption,
    tracing: Tracing,
    tell: Tell,
    text: Catalogue,
) -> RunResult:
    """Cut one part on a machine behind a link, and leave it with its drives off; say on stderr how a stop goes."""
    stopping = Stopping(interruption, text)
    reached = reach(order.machine, address, data, tracing, stopping.seen)
    try:
        guard(interruption, reached.lathe, reached.clock.now_s)
        with stopping.watching(reached.stop):
            return _cut_there(order, reached, data, tell)
    finally:
        reached.close()


def _cut_there(order: RunOrder, reached: Reached, data: Path, tell: Tell) -> RunResult:
    try:
        commissioned = Commissioned(
            reached.client, reached.heartbeat, order.machine.machine, data, simulated=reached.simulated
        )
        result = run_once(order.plan, machine_shop(reached, commissioned), tell)
        if not leave(reached.lathe, reached.owning):
            raise SessionError(Problem(code="machine.state_unknown"))
        return result
    except BaseException:
        leave(reached.lathe, reached.owning)
        raise


def _simulated_shop(
    machine: MachineProfile, true: TrueParameters | None, interruption: Interruption, tracing: Tracing
) -> Callable[[], Shop]:
    """Return a function that opens a simulated machine of its own for each part."""

    def open_shop() -> Shop:
        simulated = SimulatedLathe(machine, true)
        link = tracing.of(MemoryLink(simulated.connect(), simulated), simulated.now_s)
        stop = StopPath(link)
        interruption.guard(stop)
        client = PmacClient(link, simulated)
        heartbeat = Heartbeat(client, simulated, machine)
        lathe = Lathe(client, machine, simulated, stop, heartbeat=heartbeat)

        def turn(rpm: float | None) -> None:
            if rpm is None:
                simulated.stop_spindle()
            else:
                simulated.set_spindle_rpm(rpm)

        return Shop(
            lathe=lathe,
            clamp=simulated.mount,
            measure=simulated.measure,
            simulated=True,
            collisions=lambda: simulated.look().collisions,
            turn=turn if machine.spindle.followed else None,
        )

    return open_shop
