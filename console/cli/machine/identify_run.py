"""Identification of one machine: the one at the given address, or one in memory with --sim."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from console.cli.library import data_of, machine_of, true_parameters_of
from console.cli.machine.identify_report import Teller, response_fields
from console.cli.machine.stopping import Stopping
from console.cli.output import agreed, show, tell
from console.session.cut.trip_cause import filter_suspected
from console.session.data.identified import store
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError
from console.session.signals import Interruption
from console.session.station.owning import Owning
from console.session.station.reaching import guard, leave, reach
from console.session.station.whereabouts import address_of
from console.session.tuning.trial import TrialPlace, standing_trial
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import Strategy
from drivers.identification.identify import identify, origin_of, refuse_before, take_up
from drivers.identification.request import IdentificationRequest, request_problems
from drivers.identification.result import IdentifiedResponse, Origin
from drivers.identification.rig import Rig
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.safety import safety_problems
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import LoadedMachine

Result = TypeVar("Result")


def identify_and_keep(options: Namespace, interruption: Interruption, text: Catalogue) -> int:
    """Identify, print and keep the result; 1 without consent to move a machine."""
    loaded = machine_of(options)
    machine = loaded.machine
    request = _request(options, machine)
    teller = Teller(machine, request, text, silent=options.json, interruption=interruption)
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"identify {machine.name}")
    try:
        with reached_machine(options, loaded, interruption, tracing, text) as (rig, owning, simulated):
            guard(interruption, rig.lathe, rig.clock.now_s)
            if not simulated:
                rig.lathe.connect()
                # Nothing is sent and no control is taken before consent: the answer may take time.
                if not agreed(options, machine.name, False, text):
                    return 1
            identified = _identified(rig, owning, simulated, data_of(options), request, teller)
    finally:
        tell(tracing.problems, text)
    file = store(data_of(options), identified)
    show(options, lambda: response_fields(identified, machine, file), lambda: teller.end(identified, file))
    return 0


def _request(options: Namespace, machine: MachineProfile) -> IdentificationRequest:
    """Return the request; refuse an impossible one before anything is opened."""
    given = {"frequencies_hz": options.frequencies, "amplitude_um": options.amplitude, "periods": options.periods}
    wanted = {name: value for name, value in given.items() if value is not None}
    request = IdentificationRequest(path=Strategy(options.strategy), **wanted)
    if problems := request_problems(request, machine):
        raise SessionError(*problems)
    return request


@contextmanager
def reached_machine(
    options: Namespace, loaded: LoadedMachine, interruption: Interruption, tracing: Tracing, text: Catalogue
) -> Iterator[tuple[Rig, Owning, bool]]:
    """Connect to the machine, and yield whether it is simulated; print on stderr how one at an address stops."""
    if options.sim:
        rig = _in_memory(options, loaded.machine, interruption, tracing)
        yield rig, Owning(rig.lathe, "", data_of(options)), True
        return
    address = address_of(loaded.machine, options.link, simulated=False)
    stopping = Stopping(interruption, text)
    reached = reach(loaded, address, data_of(options), tracing, stopping.seen)
    try:
        with stopping.watching(reached.stop):
            rig = Rig(client=reached.client, lathe=reached.lathe, clock=reached.clock)
            yield rig, reached.owning, reached.simulated
    finally:
        reached.close()


def _in_memory(options: Namespace, machine: MachineProfile, interruption: Interruption, tracing: Tracing) -> Rig:
    """Return a simulated machine that runs as fast as it can be calculated."""
    simulated = SimulatedLathe(machine, true_parameters_of(options, machine))
    link = tracing.of(MemoryLink(simulated.connect(), simulated), simulated.now_s)
    stop, client = StopPath(link), PmacClient(link, simulated)
    interruption.guard(stop)
    lathe = Lathe(client, machine, simulated, stop, heartbeat=Heartbeat(client, simulated, machine))
    return Rig(client=client, lathe=lathe, clock=simulated)


def _identified(
    rig: Rig, owning: Owning, simulated: bool, data: Path, request: IdentificationRequest, teller: Teller
) -> IdentifiedResponse:
    """Enable the drives, identify, disable them, whatever ends it."""

    def work(origin: Origin) -> IdentifiedResponse:
        teller.begin(origin)
        take_up(rig)
        return identify(rig, request, origin, utc_now(), teller.tell)

    return with_origin(rig, owning, simulated, data, lambda: refuse_before(rig, request), work)


def with_origin(
    rig: Rig,
    owning: Owning,
    simulated: bool,
    data: Path,
    refuse: Callable[[], None],
    work: Callable[[Origin], Result],
) -> Result:
    """Take control, refuse what must not be, and work; the machine is left at rest, drives off, released.

    Where the tool trips in the work with a notch filter, it is told that its coefficients may be read otherwise.
    """
    version, kind = rig.lathe.connect()
    if not simulated and (unsafe := safety_problems(rig.machine, rig.lathe.snapshot().inputs)):
        raise SessionError(*unsafe)
    owning.claim()
    try:
        if rig.lathe.ownership is not None:
            rig.lathe.on_trial = _trial_gains(rig, data, simulated)
        refuse()
        try:
            return work(origin_of(rig, version=version, kind=kind, simulated=simulated))
        except ProblemError as error:
            if suspected := filter_suspected(rig.lathe, error.problems):
                raise SessionError(*error.problems, *suspected) from error
            raise
    finally:
        leave(rig.lathe, owning)


def _trial_gains(rig: Rig, data: Path, simulated: bool) -> dict[str, float]:
    """Return the gains on trial that stand in the controller as they were applied: they are tested then."""
    place = TrialPlace(client=rig.client, machine=rig.lathe.machine, data=data, simulated=simulated)
    trial = standing_trial(place, settle=True)
    return {} if trial is None or not trial.whole else dict(trial.proposed)
