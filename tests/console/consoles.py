"""Several consoles of one simulated card, each with a line of its own, also one that can be cut and mended."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from console.session.station.commands import Command
from console.session.station.context import StationContext
from console.session.station.link.reopening import ConnectionReopener
from console.session.station.machine_control import LOG_NAME, MachineControl, take_lock
from console.session.station.state import StationState
from console.session.station.station import Station
from drivers.errors import LinkError
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import OWNER_ITEM, Ownership
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import ABORT_ALL, KILL_ALL, StopPath
from drivers.link.memory import MemoryLink
from drivers.link.passing import RenewableLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import LoadedMachine, load_machine
from tests.compact import compact_machine
from tests.console.floor import LOCAL_TIME
from tests.drivers.commissioned import HeardPort

ADDRESS = "tcp:lathe:1025"
MACHINE = "lee-2001-lathe"
STOPS = ABORT_ALL + KILL_ALL
STOP_CHARACTERS = (ABORT_ALL, KILL_ALL)


@dataclass(kw_only=True)
class OneConsole:
    """A console behind a link of its own. `looks` are called with every look, before its station sees it."""

    sim: SimulatedLathe
    line: HeardPort
    client: PmacClient
    lathe: Lathe
    stop: StopPath
    owning: MachineControl
    looks: list[Callable[[Snapshot], None]] = field(default_factory=list)

    @property
    def number(self) -> int:
        assert self.lathe.ownership is not None
        return self.lathe.ownership.number

    @property
    def on_the_card(self) -> int:
        """The number of whoever controls the machine, as the card has it."""
        (held,) = self.client.numbers(OWNER_ITEM)
        return int(held)

    def hear(self) -> bytes:
        """Return what this console has said since the last time, and forget it."""
        said, self.line.heard = self.line.heard, b""
        return said


@dataclass(kw_only=True)
class WithStation(OneConsole):
    """The same with the station of a screen."""

    context: StationContext
    station: Station

    @property
    def state(self) -> StationState:
        return self.station.state

    def do(self, *commands: Command) -> StationState:
        """Order one thing after the other and have each carried out; it must be taken."""
        for command in commands:
            assert self.station.post(command), self.state.refusals
            self.station.step()
        return self.state

    def look(self) -> StationState:
        """What a station does that has nothing to do."""
        self.station.step()
        return self.state

    @property
    def alarms(self) -> list[str]:
        return [alarm.problem.code for alarm in self.state.alarms if alarm.active]

    @property
    def refusals(self) -> list[str]:
        return [problem.code for problem in self.state.refusals]


def console_of(
    sim: SimulatedLathe, machine: MachineProfile, data: Path, *, locking: bool = True, name: str = ""
) -> OneConsole:
    """Connect a console. `data` is the folder of its user, where the lock and the log are."""
    line = HeardPort(port=sim.connect())
    link = MemoryLink(line, sim)
    client, stop = PmacClient(link, sim), StopPath(link)
    looks: list[Callable[[Snapshot], None]] = []

    def tell(snapshot: Snapshot) -> None:
        for each in tuple(looks):
            each(snapshot)

    lathe = Lathe(client, machine, sim, stop, tell, Heartbeat(client, sim, machine), Ownership(client))
    lock = partial(take_lock, data, ADDRESS) if locking else None
    owning = MachineControl(lathe, ADDRESS, data, lock, name=name)
    client.connect()
    return OneConsole(sim=sim, line=line, client=client, lathe=lathe, stop=stop, owning=owning, looks=looks)


def station_of(
    sim: SimulatedLathe,
    data: Path,
    *,
    locking: bool = True,
    name: str = "",
    loaded: LoadedMachine | None = None,
) -> WithStation:
    """Connect a console with a station, as a screen has it: it claims the machine, or looks on."""
    loaded = loaded or load_machine(MACHINE)
    alone = console_of(sim, loaded.machine, data, locking=locking, name=name)
    context = StationContext(
        lathe=alone.lathe,
        owning=alone.owning,
        loaded_machine=loaded,
        clock=sim,
        shop=None,
        records=data,
        local_time=lambda: LOCAL_TIME,
        client=alone.client,
    )
    context.tell(address=ADDRESS)
    station = Station(context)
    alone.looks.append(station.take_poll)
    made = WithStation(**vars(alone), context=context, station=station)
    assert station.connect()
    return made


def logged(data: Path) -> list[str]:
    """Return the lines of the log, without their times."""
    path = data / LOG_NAME
    if not path.exists():
        return []
    return [line.split(" ", 1)[1] for line in path.read_text(encoding="utf-8").splitlines()]


TRIES = 400


class Cable:
    """All that goes through is `heard`. `cut` ends the connection; none is made before `mend`.

    Nothing comes back on the first `dead` connections.
    """

    def __init__(self, sim: SimulatedLathe, line: HeardPort, dead: int = 0) -> None:
        self.sim, self.line, self.whole, self.cuts, self.dead, self.made = sim, line, True, 0, dead, 0

    def connect(self) -> MemoryLink:
        if not self.whole:
            raise LinkError(Problem(code="link.refused", where=ADDRESS, value="Connection refused"))
        self.line.port = self.sim.connect()
        self.made += 1
        return _Piece(self)

    def cut(self) -> None:
        self.whole, self.cuts = False, self.cuts + 1
        self.sim.disconnect(self.line.port)

    def mend(self) -> None:
        self.whole = True


class _Piece(MemoryLink):
    """One connection: it ends with the cut, and stays ended when the cable is mended."""

    def __init__(self, cable: Cable) -> None:
        super().__init__(cable.line, cable.sim)
        self._cable, self._cuts, self._dead = cable, cable.cuts, cable.made <= cable.dead

    def _check(self) -> None:
        if self._cuts != self._cable.cuts:
            raise LinkError(Problem(code="link.lost", where=ADDRESS, value="Connection reset by peer"))

    def send(self, data: bytes) -> None:
        self._check()
        super().send(data)

    def send_urgent(self, data: bytes) -> None:
        self._check()
        super().send_urgent(data)

    def receive(self, timeout_s: float) -> bytes:
        self._check()
        came = super().receive(timeout_s)
        return b"" if self._dead else came


def cabled(
    sim: SimulatedLathe, data: Path, loaded: LoadedMachine | None = None, *, dead: int = 0
) -> tuple[WithStation, Cable]:
    """A console with a station at the end of a cable; it claims the machine, or looks on."""
    loaded = loaded or compact_machine()
    line = HeardPort(port=sim.connect())
    cable = Cable(sim, line, dead)
    link = RenewableLink(cable.connect())
    client, stop = PmacClient(link, sim), StopPath(link)
    looks: list[Callable[[Snapshot], None]] = []

    def tell(snapshot: Snapshot) -> None:
        for each in tuple(looks):
            each(snapshot)

    ownership = Ownership(client)
    heartbeat = Heartbeat(client, sim, loaded.machine, owner_seen=ownership.see)
    lathe = Lathe(client, loaded.machine, sim, stop, tell, heartbeat, ownership)
    owning = MachineControl(lathe, ADDRESS, data, partial(take_lock, data, ADDRESS))
    context = StationContext(
        lathe=lathe,
        owning=owning,
        loaded_machine=loaded,
        clock=sim,
        shop=None,
        records=data,
        local_time=lambda: LOCAL_TIME,
        reopening=ConnectionReopener(link, cable.connect),
    )
    context.tell(address=ADDRESS)
    station = Station(context)
    looks.append(station.take_poll)
    made = WithStation(
        sim=sim,
        line=line,
        client=client,
        lathe=lathe,
        stop=stop,
        owning=owning,
        looks=looks,
        context=context,
        station=station,
    )
    assert station.connect() is (dead == 0)
    return made, cable


def until_back(console: WithStation) -> None:
    """Let the console try until the link is back and the machine was judged."""
    moment = threading.Event()
    for _ in range(TRIES):
        lost = console.look().lost_link
        if lost is None or lost.validity:
            return
        moment.wait(0.001)  # an attempt has a thread of its own, in real time
        console.sim.wait(0.1)
    raise AssertionError(console.state)
