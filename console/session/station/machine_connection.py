"""Connection to a machine: the link to its controller, or to a simulated one, the lathe on it, and its checks."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from datetime import date
from functools import partial
from pathlib import Path

from console.session.cut.engine import CutContext
from console.session.data.stop_records import stop_record_problems
from console.session.errors import refuse
from console.session.operator import operator_name
from console.session.signals import Interruption
from console.session.station.link.onlookers import Onlookers
from console.session.station.link.reopening import ConnectionReopener
from console.session.station.machine_control import MachineControl, take_lock
from console.session.terminal_place import remote_client
from console.session.tuning.trial_checks import trial_note
from drivers.clock import Clock, RealClock
from drivers.commissioning.fingerprint import (
    ControllerFingerprint,
    console_facts,
    fingerprint_problems,
    read_fingerprint,
)
from drivers.identification.tool_gains import ToolGains
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.safety import safety_problems
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.address import LinkAddress, SimulatedAddress, WiredAddress
from drivers.link.opening import open_link
from drivers.link.passing import RenewableLink, TappedLink
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.requests.side_line import LineTraffic
from drivers.simulator.hosts.process import SimulatorProcess
from drivers.simulator.plant.which_lathe import which_lathe
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedMachine


class CommissioningGate:
    """Commissioning checks of one machine before each arm: who writes to it, its stops, how people are guarded.

    `defined` returns the axis definitions that stand now: a loaded program may have taken some away.
    """

    def __init__(
        self,
        client: PmacClient,
        heartbeat: Heartbeat,
        machine: MachineProfile,
        data: Path,
        defined: Callable[[], tuple[str, ...]],
        *,
        simulated: bool,
    ) -> None:
        self._client, self._heartbeat, self._machine = client, heartbeat, machine
        self._data, self._defined, self._simulated = data, defined, simulated
        self.fingerprint: ControllerFingerprint | None = None

    def take_fingerprint(self) -> None:
        """Read the controller's settings once; changes by somebody else from then on are reported before each arm.

        A change is accepted by connecting again, not by reading it again.
        """
        if self.fingerprint is None:
            self.fingerprint = read_fingerprint(self._client, self._machine, self._client.dialect)

    def trial_note(self) -> tuple[Problem, ...]:
        """Return that gains are on trial, to explain settings that differ; nothing where none are."""
        gains, address = ToolGains(self._client, self._machine.tool.motor), self._client.link.address
        return trial_note(self._data, self._machine, address, gains.read, simulated=self._simulated)

    def wrote(self, values: Mapping[int, float]) -> None:
        """Take I-variables that this console has written into what others' changes are told by."""
        known = self.fingerprint
        if known is not None:
            configuration = replace(known.configuration, settings={**known.configuration.settings, **values})
            self.fingerprint = replace(known, configuration=configuration)

    def problems(self, snapshot: Snapshot) -> tuple[Problem, ...]:
        """Return every reason why this machine may not be armed; `snapshot` is of now."""
        client, machine, dialect = self._client, self._machine, self._client.dialect
        return (
            *safety_problems(machine, snapshot.inputs),
            *self._heartbeat.problems(),
            *self._find_changes(),
            *stop_record_problems(client, machine, dialect, self._data, self._simulated, date.today()),
        )

    def lasting_problems(self) -> tuple[Problem, ...]:
        """Return why the machine may not be armed whatever the operator does: it is not commissioned.

        A simulated one measures its stops when it is first armed.
        """
        if self._simulated:
            return ()
        client, machine = self._client, self._machine
        return stop_record_problems(client, machine, client.dialect, self._data, False, date.today())

    def filter_doubts(self) -> tuple[Problem, ...]:
        """Return why nothing is cut with the notch filter of the profile, on the firmware that was read.

        It may take up to a second, at rest.
        """
        from console.session.tuning.air_proof import stated_filter_problems

        read = None if self.fingerprint is None else self.fingerprint.configuration
        firmware = ("", "") if read is None else (read.version, read.kind)
        return stated_filter_problems(self._machine, self._data, firmware, simulated=self._simulated)

    def _find_changes(self) -> tuple[Problem, ...]:
        before, dialect = self.fingerprint, self._client.dialect
        if before is None:
            return (Problem(code="alignment.not_verified"),)
        now = read_fingerprint(self._client, self._machine, dialect, before)
        return fingerprint_problems(before.as_defined(self._defined()), now, console_facts(self._machine, dialect))


@dataclass(frozen=True, kw_only=True)
class ConnectedMachine:
    """A connected machine to which nothing was sent yet. `shop` is there for a simulated one."""

    client: PmacClient
    lathe: Lathe
    heartbeat: Heartbeat
    stop: StopPath
    owning: MachineControl
    clock: Clock
    address: str
    shop: SimulatorProcess | None
    reopening: ConnectionReopener | None = None
    onlookers: Onlookers | None = None
    close: Callable[[], None] = field(repr=False)

    @property
    def simulated(self) -> bool:
        """Whether it is simulated."""
        return self.shop is not None


def commissioning(reached: ConnectedMachine, machine: LoadedMachine, data: Path) -> CommissioningGate:
    """Return the checks of a machine that is reached."""
    return CommissioningGate(
        reached.client,
        reached.heartbeat,
        machine.machine,
        data,
        lambda: reached.lathe.program.definitions,
        simulated=reached.simulated,
    )


def reach(
    loaded: LoadedMachine,
    address: LinkAddress,
    data: Path,
    tracing: Tracing,
    seen: Callable[[Snapshot], None] | None = None,
    heard: LineTraffic | None = None,
    clock: Clock | None = None,
) -> ConnectedMachine:
    """Open the link; for a simulated machine, start it first. `data` is the folder of this user.

    `heard` keeps what goes over the link. `clock` is the time of a lathe whose time is no real time.

    Raises:
        LinkError: a code for each kind of failure; `simulator.not_started`.
        DriverError: `safety.bad_input`.
    """
    with ExitStack() as opened:
        process: SimulatorProcess | None = None
        if isinstance(address, SimulatedAddress):
            process = _start_simulator(loaded, address, data)
            opened.callback(process.close)
            address = process.address
        link, reopening = _renewable(address, process)
        opened.callback(link.close)
        opened.callback(reopening.close)
        traced = tracing.trace_link(link, (clock := clock or RealClock()).now_s)
        traced = traced if heard is None else TappedLink(traced, heard.tap)
        stop, client, held_s = StopPath(traced), PmacClient(traced, clock), process.held_s if process else None
        ownership = Ownership(client)
        heartbeat = Heartbeat(client, clock, loaded.machine, None, ownership.see, held_s)
        lathe = Lathe(client, loaded.machine, clock, stop, seen, heartbeat, ownership)
        lathe.friction = _friction_of(loaded, data, simulated=process is not None)
        if heard is not None:
            heard.poll_line = lathe.poll_line.encode("ascii")
        return ConnectedMachine(
            client=client,
            lathe=lathe,
            heartbeat=heartbeat,
            stop=stop,
            owning=owning_of(lathe, link.address, data, simulated=process is not None),
            clock=clock,
            address=link.address,
            shop=process,
            reopening=reopening,
            onlookers=None if process else Onlookers(data, link.address),
            close=opened.pop_all().close,
        )


def _friction_of(loaded: LoadedMachine, data: Path, *, simulated: bool) -> Callable[[], str]:
    """Return what looks up the friction of the tool once something trips: no start waits for numerics."""

    def found() -> str:
        from console.session.tuning.known_loop import identified_friction

        return identified_friction(loaded.machine, data, simulated=simulated)

    return found


def _start_simulator(loaded: LoadedMachine, address: SimulatedAddress, data: Path) -> SimulatorProcess:
    """Start the simulated lathe of a profile. Raises LinkError: `simulator.not_started`."""
    return SimulatorProcess.start(
        loaded.path,
        parts_before=_parts_before(loaded, address, data),
        seed=address.seed,
        plant=address.plant,
        clamping_sd_percent=address.clamping_sd_percent,
        blind=address.blind,
        placed=address.placed,
    )


def _parts_before(loaded: LoadedMachine, address: SimulatedAddress, data: Path) -> int:
    """Return how many parts a lathe that goes on has had; 0 where the record does not say: a screen must open."""
    if not address.goes_on or address.seed is None:
        return 0
    from console.session.cut.simulated_parts import next_part

    with suppress(OSError, ProblemError):
        return next_part(data, None, loaded.machine.name, which_lathe(address.plant, address.seed)) - 1
    return 0


def owning_of(lathe: Lathe, address: str, data: Path, *, simulated: bool) -> MachineControl:
    """Return the control of a machine; if others can reach it, too, lock it here and sign at the controller."""
    if simulated:
        return MachineControl(lathe, address, data)
    lock, client = partial(take_lock, data, address), remote_client(os.environ)
    return MachineControl(lathe, address, data, lock, name=operator_name(), client=client)


def _renewable(
    address: WiredAddress, process: SimulatorProcess | None
) -> tuple[RenewableLink, ConnectionReopener]:
    """Open a link that may be opened anew; that of a simulator only as long as its process lives."""
    link = RenewableLink(open_link(address))
    over = (lambda: not process.alive) if process is not None else (lambda: False)
    return link, ConnectionReopener(link, lambda: open_link(address if process is None else process.address), over)


def guard(interruption: Interruption, lathe: Lathe, now_s: Callable[[], float] | None) -> None:
    """Stop this machine when the command is to end, from the claim on; send nothing while it is another's."""
    ownership = lathe.ownership
    interruption.guard(
        lathe.stop,
        now_s=now_s,
        anothers=lambda: lathe.anothers,
        changing=lambda: ownership is not None and ownership.standing is ConsoleRole.CHANGING,
    )


def machine_context(reached: ConnectedMachine, commissioned: CommissioningGate) -> CutContext:
    """Return a connected machine for one cut; on a real one the operator clamps and measures."""
    lathe = reached.lathe

    def admit() -> None:
        """Take control, and check the commissioning, before anything is written."""
        reached.owning.claim()
        if differing := lathe.verify():
            refuse(commissioned.trial_note(), differing)
        commissioned.take_fingerprint()
        refuse(commissioned.problems(lathe.snapshot()), commissioned.filter_doubts())

    return CutContext(
        lathe=lathe,
        workshop=reached.shop,
        commissioned=commissioned.problems,
        admit=admit,
        sets_spindle=reached.simulated and lathe.machine.spindle.followed,
    )


def leave(lathe: Lathe, owning: MachineControl) -> bool:
    """Leave the machine with its drives off and released; False when that cannot be proven. Raises no problem.

    A machine left in doubt keeps the number of this console, so that the next one must check it.
    """
    ownership = lathe.ownership
    ours = ownership is None or ownership.standing is ConsoleRole.OWNER
    if lathe.has_moved and ours and not _switched_off(lathe):
        return False
    owning.release()
    return True


def _switched_off(lathe: Lathe) -> bool:
    with suppress(ProblemError):
        if lathe.stop.reason is None:
            lathe.switch_off()
            return True
    lathe.stop.kill("end")
    if not lathe.stop.given_up:  # else the wait for rest has already timed out, and would do so again
        with suppress(ProblemError):
            lathe.wait_for_rest()
            return True
    return False
