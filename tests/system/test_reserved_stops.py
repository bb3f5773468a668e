"""Stops on a connection of their own, to the simulator's Ethernet board: while it is there, and without it."""

from __future__ import annotations

from contextlib import closing

import pytest

from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StoppedError
from drivers.link.address import EthernetAddress, parse_address
from drivers.link.base import StopWay
from drivers.link.ethernet import EthernetLink
from drivers.simulator.hosts.connection import Connection
from drivers.simulator.machine import SimulatedLathe
from tests.system.lathe_sites import Site, build, compact
from tests.system.paced_server import PacedLink, PacedServer, served

pytestmark = pytest.mark.system


def jogs_until(site: Site, way: StopWay) -> None:
    """Jog the carriage until a stop would go this way; stop it, and see it at rest with its drives on."""

    def see(snapshot: Snapshot) -> None:
        moved = snapshot.carriage.position > start + 500.0
        if moved and site.stop.way is way and site.stop.reason is None:
            site.stop.stop("operator")

    start = site.lathe.snapshot().carriage.position
    site.seen.append(see)
    with pytest.raises(StoppedError, match="operator"):
        site.lathe.jog_to(AxisName.CARRIAGE, start + 9000.0)
    site.seen.clear()
    rest = site.lathe.wait_for_rest()
    assert site.stop.proven and rest.loops_closed
    assert start + 500.0 < rest.carriage.position < start + 4000.0
    site.stop.release()


def drops(server: PacedServer, link: EthernetLink) -> None:
    """The board ends the connection for stops, as one does that is short of memory."""
    assert link._stops is not None
    name = link._stops._connection._socket.getsockname()
    (host,) = [
        each
        for each in server.hosts
        if isinstance(each, Connection) and each._transport.get_extra_info("peername") == name
    ]
    server.loop.call_soon_threadsafe(host._transport.abort)


def test_a_jog_is_stopped_on_the_connection_for_stops_and_without_it() -> None:
    machine = compact("turbo")
    with served(SimulatedLathe(machine), "ethernet") as server:
        address = parse_address(f"{server.address}?stop=reserved")
        assert isinstance(address, EthernetAddress)
        with closing(EthernetLink(address)) as link:
            site = build(PacedLink(link, server), server, machine)
            site.lathe.connect()
            site.lathe.claim()
            assert site.lathe.verify() == ()
            site.lathe.enable()
            site.lathe.home()
            jogs_until(site, StopWay.RESERVED)
            drops(server, link)
            jogs_until(site, StopWay.LOST)
            assert site.client.faults.total == 0
