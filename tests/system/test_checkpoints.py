"""Checkpoints of the simulated lathe: what was frozen goes on as it was, as often as is asked."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers.clock import RealClock
from drivers.errors import LinkError
from drivers.link.serial import SerialLink
from drivers.pmac.client import PmacClient
from drivers.simulator.hosts.process import SimulatorProcess
from profiles.store import BUNDLED_MACHINES, load_job

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

MACHINE = BUNDLED_MACHINES / "lee-2001-lathe.toml"
JOB = load_job("lee-2001-experiment-1").job


@pytest.fixture
def simulator() -> Iterator[SimulatorProcess]:
    started = SimulatorProcess.start(MACHINE, seed=1, plant="realistic")
    yield started
    started.close()


@contextmanager
def client_of(simulator: SimulatorProcess) -> Iterator[PmacClient]:
    link = SerialLink(simulator.address)
    try:
        client = PmacClient(link, RealClock())
        client.connect()
        yield client
    finally:
        link.close()


def processes_of(simulator: SimulatorProcess) -> set[int]:
    """Every living process in the session of the simulator."""
    session = simulator._child._process.pid
    found = set()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, sid = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(sid) == session and state != "Z":
            found.add(int(folder.name))
    return found


def wait_until_few(simulator: SimulatorProcess, most: int) -> None:
    until_s = time.monotonic() + 10.0
    while len(processes_of(simulator)) > most:
        assert time.monotonic() < until_s, processes_of(simulator)
        time.sleep(0.02)


def test_the_lathe_goes_back_to_each_checkpoint_as_it_was(simulator: SimulatorProcess) -> None:
    """Gauge and clamping scatter: the same trace twice means that chance was frozen, too."""
    simulator.mount(JOB)
    with client_of(simulator) as client:
        client.request("P7=1")
        simulator.fault("inject hang after=1000")
        simulator.checkpoint("a")
        client.request("P7=2")
        simulator.checkpoint("b")
        assert client.numbers("P7") == (2,)  # the link is not cut
        client.request("P7=3")
    first = simulator.measure().deviation_um
    simulator.fault("clear")
    traces = []
    for name, value in (("a", 1), ("b", 2), ("a", 1)):
        simulator.return_to(name)
        simulator.set_speed(1.0)
        assert simulator.alive
        with client_of(simulator) as client:
            assert client.numbers("P7") == (value,)
            client.request("P7=9")
        assert simulator.fault("active").startswith("hang")
        traces.append(simulator.measure().deviation_um.tolist())
    assert traces == [first.tolist()] * 3
    assert len(processes_of(simulator)) <= 4  # one that serves, two that are frozen, one that may just end


def test_nothing_is_left_when_it_is_closed_or_killed(simulator: SimulatorProcess) -> None:
    simulator.checkpoint("a")
    simulator.return_to("a")
    wait_until_few(simulator, 2)
    device = simulator.address.device
    assert Path(device).exists()
    simulator.close()
    wait_until_few(simulator, 0)
    assert not Path(device).exists()
    assert not simulator.alive


def test_a_copy_that_is_killed_is_gone_and_its_checkpoint_is_not(simulator: SimulatorProcess) -> None:
    simulator.checkpoint("a")
    (frozen,) = processes_of(simulator) - {simulator._child._process.pid}
    simulator.return_to("a")
    wait_until_few(simulator, 2)
    (serving,) = processes_of(simulator) - {frozen}
    os.kill(serving, signal.SIGKILL)
    wait_until_few(simulator, 1)
    assert not simulator.alive
    with pytest.raises(LinkError, match="simulator"):
        simulator.look()
    wait_until_few(simulator, 0)


def test_a_checkpoint_that_was_never_set_is_refused_and_the_lathe_stays(simulator: SimulatorProcess) -> None:
    with pytest.raises(LinkError) as refused:
        simulator.return_to("a")
    assert refused.value.problems[0].code == "simulator.refused"
    simulator.mount(JOB)
    assert simulator.alive
