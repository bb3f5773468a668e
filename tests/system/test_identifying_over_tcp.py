"""A lathe is proposed the same gains over a socket as in memory: its readings differ by their noise alone."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from console.session.data.identified_responses import store
from console.session.tuning.proposal import gain_facts
from drivers.clock import Clock
from drivers.cutting.strategy import Strategy
from drivers.identification.identify import identify, origin_of, take_up
from drivers.identification.request import IdentificationRequest
from drivers.identification.rig import Rig
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.stop import StopPath
from drivers.link.address import parse_host_port
from drivers.link.base import Link
from drivers.link.memory import MemoryLink
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.store import load_machine
from tests.system.patient_card import PacedLink, served

pytestmark = [pytest.mark.system, pytest.mark.long]

MACHINE = load_machine("lee-2001-lathe").machine
SWEEPS = (
    ((25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 95.0), 50.0, 20),
    ((60.0, 90.0, 120.0, 165.0, 225.0), 35.0, 60),
    ((240.0, 280.0, 320.0, 400.0, 520.0, 700.0, 800.0, 900.0), 10.0, 60),
)
"""Hz, um and periods: those that the console asks for, with fewer frequencies."""


def proposed(link: Link, clock: Clock, data: Path) -> dict[str, float]:
    """The gains that are proposed after the three sweeps."""
    client = PmacClient(link, clock)
    ownership = Ownership(client, Random(1))
    heartbeat = Heartbeat(client, clock, MACHINE, owner_seen=ownership.see)
    lathe = Lathe(client, MACHINE, clock, StopPath(link), heartbeat=heartbeat, ownership=ownership)
    version, kind = lathe.connect()
    lathe.claim()
    lathe.verify()
    rig = Rig(client=client, lathe=lathe, clock=clock)
    take_up(rig)
    origin = origin_of(rig, version=version, kind=kind, simulated=True)
    for place, (hz, um, periods) in enumerate(SWEEPS):
        request = IdentificationRequest(path=Strategy.PVT, frequencies_hz=hz, amplitude_um=um, periods=periods)
        store(data, identify(rig, request, origin, f"2001-11-30T14:0{place}:00.000Z"))
    facts = gain_facts(MACHINE, None, data, simulated=True)
    assert facts.proposal is not None, facts.reasons
    return facts.proposal.settings


def test_a_served_lathe_has_the_proposal_of_one_in_memory_up_to_900_hz(tmp_path: Path) -> None:
    one, other = (SimulatedLathe(MACHINE, plant_named("steady", MACHINE, 5)) for _ in range(2))
    with served(other, "tcp") as server:
        with closing(TcpLink(parse_host_port(server.address.removeprefix("tcp:")))) as link:
            over_tcp = proposed(PacedLink(link, server), server, tmp_path / "served")
    assert over_tcp == proposed(MemoryLink(one.connect(), one), one, tmp_path / "memory")
