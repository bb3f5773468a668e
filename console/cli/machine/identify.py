"""`console identify`: frequency response of the tool on the path of a strategy, as a table like Table 5."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import (
    add_hardware,
    add_link,
    add_machine,
    add_sim,
    number,
    strategy_names,
    whole_number,
)
from console.cli.parser import Parser
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import DEFAULT_STRATEGY, INVERTING, Strategy

if TYPE_CHECKING:
    from console.cli.machine.identify_lines import Teller
    from console.session.station.owning import Owning
    from drivers.identification.request import IdentificationRequest
    from drivers.identification.result import IdentifiedResponse
    from drivers.identification.rig import Rig
    from drivers.link.tracing import Tracing
    from profiles.store import LoadedMachine

WRONG_USAGE = 2


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, simulated or real, the path, and the excitation."""
    add_machine(parser, text)
    add_sim(parser, text, "help.identify.sim")
    add_hardware(parser, text)
    add_link(parser, text)
    told = ", ".join(text(f"strategy.{each}.path") for each in INVERTING)
    names = strategy_names(INVERTING)
    path_help = text("help.identify.strategy", default=DEFAULT_STRATEGY, strategies=told)
    parser.add_argument("--strategy", choices=names, default=DEFAULT_STRATEGY.value, help=path_help)
    frequencies_help = text("help.identify.frequencies")
    parser.add_argument("--frequencies", metavar="HZ,HZ", type=_frequencies, help=frequencies_help)
    parser.add_argument("--amplitude", metavar="UM", type=number, help=text("help.identify.amplitude"))
    parser.add_argument("--periods", metavar="N", type=whole_number, help=text("help.identify.periods"))
    parser.add_argument("--yes", action="store_true", help=text("help.identify.yes"))


def _frequencies(words: str) -> tuple[float, ...]:
    return tuple(number(word) for word in words.split(","))


def main(options: Namespace, text: Catalogue) -> int:
    """Identify, print and keep the result; 2 for options that belong to a simulated machine alone.

    Raises:
        ProblemError: a refusal before anything moved, or what ended it; the machine is at rest.
    """
    interruption = Interruption()
    interruption.install()
    from console.cli.library import plant_given

    if plant_given(options) and not options.sim:
        print(f"console identify: {text('usage.plant_without_sim')}", file=sys.stderr)
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; signals are already handled.
    from console.cli.library import data_of, machine_of
    from console.cli.machine.identify_fields import response_fields
    from console.cli.machine.identify_lines import Teller
    from console.cli.output import print_json, tell
    from console.session.data.identified import store
    from console.session.station.reaching import guard
    from drivers.link.tracing import Tracing

    machine = machine_of(options)
    request = _request(options, machine)
    teller = Teller(machine.machine, request, text, silent=options.json, interruption=interruption)
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"identify {machine.machine.name}")
    try:
        with _reached(options, machine, interruption, tracing, text) as (rig, owning, simulated):
            guard(interruption, rig.lathe, rig.clock.now_s)
            if not simulated and not _agreed(options, rig, text):
                return 1
            identified = _identified(rig, owning, simulated, request, teller)
    finally:
        tell(tracing.problems, text)
    file = store(data_of(options), identified)
    if options.json:
        print_json(response_fields(identified, machine.machine, str(file)))
    else:
        print("\n".join(teller.end(identified, file)))
    return 0


def _request(options: Namespace, machine: LoadedMachine) -> IdentificationRequest:
    """Return the request.

    Raises:
        SessionError: everything that forbids it; nothing was opened.
    """
    from drivers.identification.request import (
        AMPLITUDE_UM,
        FREQUENCIES_HZ,
        PERIODS,
        IdentificationRequest,
        request_problems,
    )

    request = IdentificationRequest(
        path=Strategy(options.strategy),
        frequencies_hz=FREQUENCIES_HZ if options.frequencies is None else options.frequencies,
        amplitude_um=AMPLITUDE_UM if options.amplitude is None else options.amplitude,
        periods=PERIODS if options.periods is None else options.periods,
    )
    if problems := request_problems(request, machine.machine):
        raise SessionError(*problems)
    return request


@contextmanager
def _reached(
    options: Namespace, machine: LoadedMachine, interruption: Interruption, tracing: Tracing, text: Catalogue
) -> Iterator[tuple[Rig, Owning | None, bool]]:
    """Connect to the machine: one in memory with --sim, else the one at the given address.

    For the latter, print on stderr how to stop it.

    Raises:
        ProblemError: no address was given, or nothing can be reached there.
    """
    from console.cli.library import data_of
    from console.cli.machine.stopping import Stopping
    from console.session.station.reaching import reach
    from console.session.station.whereabouts import address_of
    from drivers.identification.rig import Rig

    if options.sim:
        yield _in_memory(options, machine, interruption, tracing), None, True
        return
    address = address_of(machine.machine, options.link, simulated=False)
    stopping = Stopping(interruption, text)
    reached = reach(machine, address, data_of(options), tracing, stopping.seen)
    try:
        rig = Rig(client=reached.client, lathe=reached.lathe, clock=reached.clock)
        with stopping.watching(reached.stop):
            yield rig, reached.owning, reached.simulated
    finally:
        reached.close()


def _in_memory(options: Namespace, machine: LoadedMachine, interruption: Interruption, tracing: Tracing) -> Rig:
    """Return a simulated machine that runs as fast as it can be calculated.

    Raises:
        ProblemError: as `true_parameters_of`.
    """
    from console.cli.library import true_parameters_of
    from drivers.identification.rig import Rig
    from drivers.lathe.heartbeat import Heartbeat
    from drivers.lathe.lathe import Lathe
    from drivers.lathe.stop import StopPath
    from drivers.link.memory import MemoryLink
    from drivers.pmac.client import PmacClient
    from drivers.simulator.machine import SimulatedLathe

    simulated = SimulatedLathe(machine.machine, true_parameters_of(options, machine.machine))
    link = tracing.of(MemoryLink(simulated.connect(), simulated), simulated.now_s)
    stop, client = StopPath(link), PmacClient(link, simulated)
    interruption.guard(stop)
    heartbeat = Heartbeat(client, simulated, machine.machine)
    lathe = Lathe(client, machine.machine, simulated, stop, heartbeat=heartbeat)
    return Rig(client=client, lathe=lathe, clock=simulated)


def _agreed(options: Namespace, rig: Rig, text: Catalogue) -> bool:
    """Ask for consent before anything is sent or control is taken: the answer may take time.

    Raises:
        LinkError: no PMAC answers.
    """
    from console.cli.agreement import agreed

    rig.lathe.connect()
    return agreed(options, rig.machine.name, False, text, "identify")


def _identified(
    rig: Rig,
    owning: Owning | None,
    simulated: bool,
    request: IdentificationRequest,
    teller: Teller,
) -> IdentifiedResponse:
    """Enable the drives, identify, disable them.

    Raises:
        ProblemError: a refusal, or what went wrong; the machine is at rest with its drives off.
    """
    from console.session.station.reaching import leave
    from drivers.identification.identify import identify, origin_of, refuse_before, take_up
    from drivers.lathe.safety import safety_problems

    version, kind = rig.lathe.connect()
    unsafe = () if simulated else safety_problems(rig.machine, rig.lathe.snapshot().inputs)
    if unsafe:
        raise SessionError(*unsafe)
    if owning is not None:
        owning.claim()
    try:
        refuse_before(rig, request)
        origin = origin_of(rig, version=version, kind=kind, simulated=simulated)
        teller.begin(origin)
        take_up(rig)
        return identify(rig, request, origin, utc_now(), teller.tell)
    finally:
        leave(rig.lathe, owning)
