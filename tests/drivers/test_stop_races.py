"""The stop against everything that can happen at the same time: lines on their way, lost replies, coasting."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from drivers.errors import DriverError
from drivers.lathe.lathe import Lathe
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.exchange import FLUSH
from drivers.pmac.program_text import read_program
from tests.drivers.families import machine as machine

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

SPIN = "OPEN PROG 3\nCLEAR\nINC\nTA200 TS50 TM20000\nY1000000\nCLOSE\n"


class Tampered(MemoryLink):
    """A link on which something happens just before a line leaves, or on which replies are lost."""

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench.port, bench.sim)
        self.bench = bench
        self.before_send: Callable[[bytes], None] = lambda data: None
        self.deaf_for = 0
        self.unasked = b""
        self.urgent: list[tuple[float, bytes]] = []

    def send(self, data: bytes) -> None:
        self.before_send(data)
        super().send(data)

    def send_urgent(self, data: bytes) -> None:
        self.urgent.append((self.bench.sim.now_s(), data))
        super().send_urgent(data)

    def receive(self, timeout_s: float) -> bytes:
        unasked, self.unasked = self.unasked, b""
        data = unasked + super().receive(timeout_s)
        if self.deaf_for and data:
            self.deaf_for -= 1
            return b""
        return data


def tampered(bench: Bench, *, enabled: bool = True) -> tuple[Tampered, Lathe, StopPath]:
    link = Tampered(bench)
    stop = StopPath(link)
    lathe = Lathe(PmacClient(link, bench.sim), bench.lathe.machine, bench.sim, stop)
    lathe.connect()
    lathe.verify()
    if enabled:
        lathe.enable()
    return link, lathe, stop


@pytest.mark.parametrize("start", [lambda lathe: lathe.home(), lambda lathe: lathe.program.start(3, 0.0)])
def test_a_stop_that_overtakes_a_move_is_sent_again(bench: Bench, start: Callable[[Lathe], None]) -> None:
    """The signal comes between the last check and the send: the motion must not outlive the next few ms."""
    link, lathe, stop = tampered(bench)
    lathe.program.load(read_program(SPIN))
    lathe.snapshot()
    places = {motor: bench.sim.controller.motors[motor].actual for motor in (1, 2, 3)}
    link.before_send = lambda data: stop.stop("signal")
    with pytest.raises(StoppedError):
        start(lathe)
    link.before_send = lambda data: None
    snapshot = lathe.wait_for_rest()
    assert snapshot.at_rest
    bench.sim.wait(1.0)
    for motor, place in places.items():
        assert bench.sim.controller.motors[motor].actual == pytest.approx(place, abs=5)


@pytest.mark.parametrize("start", [lambda lathe: lathe.home(), lambda lathe: lathe.program.start(3, 0.0)])
def test_nothing_that_moves_leaves_behind_a_stop(bench: Bench, start: Callable[[Lathe], None]) -> None:
    """Something came unasked, and while the line is emptied and proven anew somebody stops."""
    link, lathe, stop = tampered(bench)
    lathe.program.load(read_program(SPIN))
    lathe.snapshot()
    said: list[bytes] = []

    def hear(data: bytes) -> None:
        said.append(data)
        if FLUSH in data and stop.reason is None:
            stop.stop("signal")

    link.unasked, link.before_send = b"?", hear
    with pytest.raises(StoppedError):
        start(lathe)
    assert FLUSH in said
    assert not any(b"HM" in data or b"R\r" in data for data in said)
    assert [data for _, data in link.urgent] == [b"\x01"], "what was not sent needs no second stop"


def test_a_kill_that_overtakes_a_line_that_closes_a_loop_leaves_it_open(bench: Bench) -> None:
    link, lathe, stop = tampered(bench, enabled=False)

    def kill(data: bytes) -> None:
        if data.startswith(b"#2J/"):
            stop.stop("signal")

    link.before_send = kill
    with pytest.raises(StoppedError):
        lathe.enable()
    link.before_send = lambda data: None
    assert lathe.wait_for_rest().loops_open
    assert not any(motor.enabled for motor in bench.sim.controller.motors.values())


def test_an_older_reply_does_not_turn_a_kill_into_an_abort(bench: Bench) -> None:
    """Control-K goes out while a look is being answered; the answer still says closed."""
    _, lathe, stop = tampered(bench)
    stop.kill("operator")
    stop.loops_closed = True
    stop.stop("again")
    stop.repeat()
    bench.sim.wait(0.1)
    assert not any(motor.enabled for motor in bench.sim.controller.motors.values())
    assert lathe.wait_for_rest().loops_open


def test_a_lost_reply_in_a_cut_costs_one_look_and_nothing_else(bench: Bench) -> None:
    link, lathe, _ = tampered(bench)
    lathe.program.load(read_program(SPIN.replace("TM20000", "TM1000").replace("1000000", "20000")))
    lathe.program.start(3, 0.0)
    link.deaf_for = 1
    assert lathe.program.follow(lambda snapshot: None, timeout_s=20.0).in_position
    assert link.urgent == []


def test_the_stop_is_repeated_at_five_hertz_while_no_reply_comes(bench: Bench) -> None:
    link, lathe, stop = tampered(bench)
    link.deaf_for = 10**9
    began = bench.sim.now_s()
    stop.stop("operator")
    with pytest.raises(DriverError) as unproven:
        lathe.wait_for_rest()
    assert unproven.value.problems[0].code == "machine.rest_unknown"
    seconds = bench.sim.now_s() - began
    assert seconds >= 15.0
    gaps = [later[0] - earlier[0] for earlier, later in zip(link.urgent, link.urgent[1:], strict=False)]
    assert max(gaps) <= 0.25
    assert [data for _, data in link.urgent[:3]] == [b"\x01", b"\x0b", b"\x0b"]
    assert {data for _, data in link.urgent[2:]} == {b"\x0b"}, "an unknown state is killed"


def test_a_spindle_that_runs_out_after_a_kill_is_proven_at_rest(bench: Bench) -> None:
    _, lathe, stop = tampered(bench)
    lathe.program.load(read_program(SPIN.replace("1000000", "3333333")))
    lathe.program.start(3, 0.0)
    bench.sim.wait(5.0)
    stop.kill("operator")
    snapshot = lathe.wait_for_rest()
    assert snapshot.loops_open
    turned = bench.sim.controller.motors[2].actual
    bench.sim.wait(3.0)
    assert bench.sim.controller.motors[2].actual == pytest.approx(turned, abs=50)


def test_a_ramp_that_had_to_become_a_kill_has_the_time_to_run_out(bench: Bench) -> None:
    """Control-A, then a lost reply: the drives are in doubt, control-K follows at full speed."""
    link, lathe, stop = tampered(bench)
    bench.client.request("I215=0.02")
    lathe.program.load(read_program(SPIN.replace("1000000", "3333333")))
    lathe.program.start(3, 0.0)
    bench.sim.wait(5.0)
    lathe.snapshot()
    link.deaf_for = 2
    stop.stop("operator")
    began = bench.sim.now_s()
    assert lathe.wait_for_rest().loops_open
    assert link.urgent[0][1] == b"\x01"
    assert bench.sim.now_s() - began > 15.0


def test_a_motor_that_nobody_knows_is_told_and_no_abort_would_close_it(bench: Bench) -> None:
    bench.client.request("I500=1")
    _, lathe, stop = tampered(bench)
    assert [p.key for p in lathe.verify()] == ["I500"]
    lathe.snapshot()
    assert not stop.loops_closed


def test_what_is_refused_before_anything_moved_leaves_the_machine_alone(bench: Bench) -> None:
    link, lathe, _ = tampered(bench, enabled=False)
    moved = [lathe.has_moved]
    assert link.urgent == []
    lathe.enable()
    assert [*moved, lathe.has_moved] == [False, True]
