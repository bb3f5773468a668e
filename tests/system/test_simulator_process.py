"""The simulated lathe as a process of its own: a serial line like a real one, and gone when nobody needs it."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.clock import RealClock
from drivers.errors import LinkError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StopPath
from drivers.link.serial import SerialLink
from drivers.pmac.client import PmacClient
from drivers.simulator.hosts.process import SimulatorProcess
from profiles.roundness import evaluate
from profiles.store import BUNDLED_MACHINES, load_job, load_machine

pytestmark = [pytest.mark.system, pytest.mark.long]

MACHINE = BUNDLED_MACHINES / "lee-2001-lathe.toml"
JOB = load_job("lee-2001-experiment-1").job

PARENT = """
import sys, time
from pathlib import Path
from drivers.simulator.hosts.process import SimulatorProcess
simulator = SimulatorProcess.start(Path(sys.argv[1]))
print(simulator._child._process.pid, simulator.address.device, flush=True)
time.sleep(60)
"""


@pytest.fixture
def simulator() -> Iterator[SimulatorProcess]:
    started = SimulatorProcess.start(MACHINE, seed=1)
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


def pid_of(simulator: SimulatorProcess) -> int:
    return simulator._child._process.pid


def wait_until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def alive(pid: int) -> bool:
    """Whether a process is there and no zombie that its parent has not yet asked for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def code_of(action: Callable[[], object]) -> str:
    with pytest.raises(LinkError) as error:
        action()
    return error.value.problems[0].code


def test_the_lathe_is_verified_homed_and_jogged_over_the_serial_line(simulator: SimulatorProcess) -> None:
    link = SerialLink(simulator.address)
    client = PmacClient(link, RealClock())
    lathe = Lathe(client, load_machine("lee-2001-lathe").machine, RealClock(), StopPath(link))
    version, kind = lathe.connect()
    assert float(version) > 1
    assert "PMAC" in kind
    assert client.query("VERSION") == (version,)
    assert lathe.verify() == ()
    lathe.enable()
    lathe.home()
    lathe.jog_to(AxisName.SPINDLE, 1234.0)
    snapshot = lathe.snapshot()
    assert snapshot.homed
    assert snapshot.spindle.position == pytest.approx(1234, abs=10)
    link.close()


def test_a_blank_is_clamped_seen_and_measured(simulator: SimulatorProcess) -> None:
    before = simulator.look()
    assert before.tool_gap_mm is None
    simulator.mount(replace(JOB, jaws=4, lobe_error_um_pp=21.0, assumed=("feed_mm_per_rev",), source="깎기 전"))
    # Nothing turned: the chuck is where it was.
    assert simulator.look().jaw_1_past_mark_deg == before.jaw_1_past_mark_deg
    trace = simulator.measure()
    assert trace.angle_deg.shape == trace.deviation_um.shape == (3600,)
    assert trace.meta["simulated"] == "yes"
    assert not trace.deviation_um.flags.writeable
    result = evaluate(trace.angle_deg, trace.deviation_um, None)
    assert result.amplitude_um(4) == pytest.approx(10.5, abs=0.001)
    # Left at 0.3456 turns: the crest of the part and the jaw that is seen tell the same angle.
    jaw_1_deg = 0.3456 * 360 - before.jaw_1_past_mark_deg
    phase_deg = next(h.phase_deg for h in result.harmonics if h.n == 4)
    assert np.cos(np.radians(4 * (phase_deg - jaw_1_deg))) == pytest.approx(1, abs=1e-6)


def test_two_lathes_are_set_up_differently_unless_they_have_the_same_seed() -> None:
    seen = []
    for seed in (5, 5, None, None):
        simulator = SimulatorProcess.start(MACHINE, seed=seed)
        seen.append(simulator.look())
        simulator.close()
    assert seen[0] == seen[1]
    assert seen[2] != seen[3]


def test_it_says_which_lathe_it_is_and_whether_its_parts_differ(tmp_path: Path) -> None:
    plant = tmp_path / "mine, seed 3.toml"
    plant.write_text("[chuck]\nlobe_factor = 1.2\n", encoding="utf-8")
    told = []
    for words in ({"plant": str(plant)}, {"plant": "mounted", "clamping_sd_percent": 5.0}, {"plant": "steady"}):
        simulator = SimulatorProcess.start(MACHINE, seed=5, **words)
        told.append((simulator.which, simulator.parts_differ))
        simulator.close()
    lathes, differ = zip(*told, strict=True)
    assert [(each.plant[:17], each.seed, each.alike) for each in lathes] == [
        ("mine, seed 3.toml", 5, True),
        ("ideal", 5, True),
        ("steady", 5, False),
    ]
    assert differ == (False, True, True)


def test_it_refuses_what_cannot_be_done_serves_the_next_host_and_ends_when_it_is_closed(
    simulator: SimulatorProcess,
) -> None:
    """It has a session of its own and says nothing: Ctrl-C on the terminal of the console is not meant for it."""
    for refused in (lambda: simulator.set_spindle(800.0), lambda: simulator.set_spindle(None), simulator.measure):
        assert code_of(refused) == "simulator.refused"
    assert simulator.look().collisions == ()
    assert code_of(lambda: simulator.mount(replace(JOB, jaws=999))) == "simulator.refused"
    simulator.mount(JOB)
    assert len(simulator.measure().angle_deg) == 3600
    with client_of(simulator) as client:
        client.request("P7=42")
    with client_of(simulator) as client:
        assert client.numbers("P7") == (42,)
    pid = pid_of(simulator)
    assert os.getsid(pid) == pid
    terminal = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[4]
    assert terminal == "0"
    assert [os.readlink(f"/proc/{pid}/fd/{number}") for number in (0, 1)] == ["/dev/null"] * 2
    assert not os.readlink(f"/proc/{pid}/fd/2").startswith("/dev/")
    simulator.close()
    assert not alive(pid)
    simulator.close()
    assert code_of(simulator.look) == "simulator.gone"


def test_a_spindle_on_an_inverter_is_set_and_runs_out(tmp_path: Path) -> None:
    """60 rpm in 0.12 s, and at least 0.1 turns a second then."""
    inverter = '[spindle]\ndrive = "inverter"\nramp_rpm_per_s = 500.0\nslip_rpm = 60.0'
    text = MACHINE.read_text(encoding="utf-8").replace("[spindle]", inverter)
    machine = tmp_path / "inverter.toml"
    machine.write_text(re.sub(r'"#2->[^"]*"', '"#2->0"', text), encoding="utf-8")
    simulator = SimulatorProcess.start(machine, seed=1)
    seen_deg = simulator.look().jaw_1_past_mark_deg
    simulator.set_spindle(60.0)
    wait_until(lambda: simulator.look().jaw_1_past_mark_deg != seen_deg)
    simulator.set_spindle(None)
    simulator.close()


def test_the_clock_runs_in_real_time_also_while_parts_are_measured(simulator: SimulatorProcess) -> None:
    """100 rpm for about a second: 10 000 counts a turn, 16.667 counts a ms."""
    simulator.mount(JOB)
    with client_of(simulator) as client:
        client.request("#2J/")
        client.request("#2J+")
        time.sleep(0.5)
        (first,), began = client.numbers("#2P"), time.monotonic()
        while time.monotonic() < began + 1.0:
            simulator.measure()
            client.numbers("P1")  # time does not run away from a host that says nothing
        (second,), ended = client.numbers("#2P"), time.monotonic()
        client.request("#2J/")
    assert (second - first) / (ended - began) == pytest.approx(16_667, rel=0.05)


def test_a_host_that_does_not_read_costs_no_memory_and_is_answered_when_it_flushes(
    simulator: SimulatorProcess,
) -> None:
    def memory_kb() -> int:
        status = Path(f"/proc/{pid_of(simulator)}/status").read_text()
        return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))

    link = SerialLink(simulator.address)
    before_kb = memory_kb()
    ended = time.monotonic() + 3.0
    while time.monotonic() < ended:
        # About 3 kB of answers for each of these lines.
        with suppress(LinkError):
            link.send_urgent(b"P0..1000\r")
        time.sleep(0.001)
    assert memory_kb() - before_kb < 10_000
    link.close()
    with client_of(simulator) as client:
        assert client.numbers("P1") == (0,)


def test_a_flood_keeps_neither_the_channel_nor_the_stop_waiting(simulator: SimulatorProcess) -> None:
    link = SerialLink(simulator.address)
    flooding = threading.Event()

    def flood() -> None:
        with suppress(LinkError):
            while not flooding.is_set():
                link.send(b"P0..100\r" * 50)

    sender = threading.Thread(target=flood)
    sender.start()
    worst_s = 0.0
    for _ in range(100):
        began = time.monotonic()
        simulator.look()
        worst_s = max(worst_s, time.monotonic() - began)
    simulator.close()
    flooding.set()
    sender.join(10)
    link.close()
    assert worst_s < 0.5


def test_a_parent_that_is_killed_takes_the_simulator_and_its_line_with_it(tmp_path: Path) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(MACHINE)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with parent:
        assert parent.stdout is not None
        word, device = parent.stdout.readline().split()
        child = int(word)
        assert alive(child)
        # Of the line: a host that is still connected sees it end.
        line = os.open(device, os.O_RDWR | os.O_NOCTTY)
        made = os.stat(device).st_ctime_ns
        parent.kill()
        readable, _, _ = select.select([line], [], [], 2.0)
        assert readable
        with suppress(OSError):
            assert os.read(line, 10) == b""
        os.close(line)
        wait_until(lambda: not alive(child), 2.0)
        # The name may belong to a line of somebody else by now.
        with suppress(FileNotFoundError):
            assert os.stat(device).st_ctime_ns != made


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_it_cleanly(simulator: SimulatorProcess, number: signal.Signals) -> None:
    process = simulator._child._process
    process.send_signal(number)
    assert process.wait(5) == 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_a_simulator_that_dies_is_told_by_line_and_channel(simulator: SimulatorProcess, number: int) -> None:
    link = SerialLink(simulator.address)
    os.kill(pid_of(simulator), number)
    assert code_of(lambda: link.receive(5.0)) == "link.lost"
    for action in (simulator.look, simulator.measure, lambda: simulator.mount(JOB)):
        assert code_of(action) == "simulator.gone"
    link.close()
    simulator.close()


def test_a_simulator_that_does_not_answer_is_given_up_and_ended(
    simulator: SimulatorProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.simulator.hosts.process.REQUEST_TIMEOUT_S", 0.3)
    monkeypatch.setattr("drivers.simulator.hosts.process.END_TIMEOUT_S", 0.3)
    pid = pid_of(simulator)
    os.kill(pid, signal.SIGSTOP)
    began = time.monotonic()
    assert code_of(simulator.look) == "simulator.gone"
    assert time.monotonic() - began < 3.0
    assert not alive(pid)


def test_a_machine_that_cannot_be_loaded_is_told_with_its_reason(tmp_path: Path) -> None:
    with pytest.raises(LinkError) as refused:
        SimulatorProcess.start(tmp_path / "missing.toml")
    (problem,) = refused.value.problems
    assert problem.code == "simulator.not_started"
    assert problem.where == str(tmp_path / "missing.toml")
    assert "file.unreadable" in problem.value


def test_a_start_that_takes_too_long_is_given_up_and_leaves_nothing() -> None:
    children = Path(f"/proc/self/task/{threading.get_native_id()}/children")
    before = children.read_text()
    assert code_of(lambda: SimulatorProcess.start(MACHINE, timeout_s=0.001)) == "simulator.not_started"
    assert children.read_text() == before


def test_it_starts_in_a_folder_with_packages_of_the_same_name_and_from_a_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("drivers", "profiles", "json"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise SystemExit('a stray package')\n")
    machine = os.path.relpath(MACHINE, tmp_path)
    monkeypatch.chdir(tmp_path)
    started: list[SimulatorProcess] = []
    thread = threading.Thread(target=lambda: started.append(SimulatorProcess.start(Path(machine))))
    thread.start()
    thread.join(20)
    assert started[0].look().tool_gap_mm is None
    started[0].close()


@pytest.mark.parametrize("descriptor", ["0", "999", "x"])
def test_without_a_channel_the_command_says_so(descriptor: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "drivers.simulator", "--channel", descriptor, "--machine", str(MACHINE)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=20,
    )
    assert done.returncode == 2
    assert "--channel" in done.stderr
    assert "Traceback" not in done.stderr
