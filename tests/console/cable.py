"""A console whose cable can be cut and mended: in memory, on a clock that is advanced."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

from console.session.station.context import StationContext
from console.session.station.link.reopening import Reopening
from console.session.station.owning import Owning, take_lock
from console.session.station.station import Station
from drivers.errors import LinkError
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.link.passing import RenewableLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.problem import Problem
from profiles.store import LoadedMachine
from tests.compact import compact_machine
from tests.console.consoles import ADDRESS, WithStation
from tests.console.floor import LOCAL_TIME
from tests.drivers.commissioned import HeardPort

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
    owning = Owning(lathe, ADDRESS, data, partial(take_lock, data, ADDRESS))
    context = StationContext(
        lathe=lathe,
        owning=owning,
        loaded_machine=loaded,
        clock=sim,
        shop=None,
        records=data,
        local_time=lambda: LOCAL_TIME,
        reopening=Reopening(link, cable.connect),
    )
    context.tell(address=ADDRESS)
    station = Station(context)
    looks.append(station.seen)
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
