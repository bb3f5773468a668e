"""Stops: control-A, control-K, trips, the choice between them; and the jogs of setting up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import DriverError, LinkError, LinkTimeoutError
from drivers.lathe.lathe import Lathe
from drivers.lathe.lengths import settings_of
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.base import StopWay
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import FamilySetting
from profiles.machine import MachineProfile
from profiles.problem import Problem
from tests.drivers.conftest import Bench
from tests.drivers.families import machine as machine


class Wire:
    """A link that only writes down what is sent."""

    address = "wire"
    stop_way = StopWay.DIRECT
    checks_bytes = True

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.urgent: list[bytes] = []
        self.broken = False

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def receive(self, timeout_s: float) -> bytes:
        return b""

    def send_urgent(self, data: bytes) -> None:
        if self.broken:
            raise LinkError(Problem(code="link.lost"))
        self.urgent.append(data)

    def close(self) -> None:
        pass


@pytest.mark.parametrize(("rate", "stopping_distance"), [(0.25, 3732.48), (13.6, 68.6)])
def test_control_a_runs_on_by_the_square_of_the_speed_over_twice_ix15(
    closed: Bench, rate: float, stopping_distance: float
) -> None:
    """43.2 counts/ms, the peak speed of the lobe: 0.75 mm at the factory's 0.25, 14 um at 13.6 counts/ms2."""
    closed.client.request(f"I315={rate} I322=43.2 I320=50 I321=0")
    recorder = closed.record(3)
    closed.client.request("#3J+")
    closed.sim.wait(0.5)
    closed.port.receive(b"\x01")
    closed.sim.wait(0.006)
    place = len(recorder.commands)
    while recorder.commands[place - 1] - recorder.commands[place - 2] < 43.19 * closed.cycle_ms:
        place -= 1
    closed.settle()
    assert recorder.commands[-1] - recorder.commands[place - 1] == pytest.approx(
        stopping_distance, abs=43.2 * 0.45
    )
    assert closed.lathe.snapshot().loops_closed


def test_control_a_ramps_down_a_program_without_a_jump(closed: Bench) -> None:
    closed.client.request("I115=2 I215=2 I315=2")
    recorder = closed.record(2)
    closed.program("INC", "TA50 TS0 TM2000", "Y200000")
    closed.client.request("R")
    closed.sim.wait(0.5)
    before = closed.sim.controller.motors[2].desired
    assert closed.raw(b"\x01") == b""
    closed.settle()
    velocity = np.diff(recorder.commands) / closed.cycle_ms
    assert velocity.max() == pytest.approx(100)
    assert np.abs(np.diff(velocity)).max() <= 2.0 * closed.cycle_ms * 1.01
    stopping_distance = recorder.commands[-1] - before
    assert 100**2 / (2 * 2) <= stopping_distance <= 100**2 / (2 * 2) + 100 * 6
    assert not closed.lathe.snapshot().program_running


def test_a_rate_of_zero_never_stops_the_motor(closed: Bench) -> None:
    closed.client.request("I315=0 #3J+")
    closed.sim.wait(0.5)
    closed.raw(b"\x01")
    first = closed.number("#3P")
    closed.sim.wait(5.0)
    assert closed.number("#3P") - first == pytest.approx(50_000, rel=0.01)
    closed.raw(b"\x0b")


def test_control_k_opens_every_loop_and_the_axes_coast(closed: Bench) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(1.0)
    closed.raw(b"\x0b")
    snapshot = closed.lathe.snapshot()
    for axis in snapshot.axes:
        assert "open_loop" in axis.flags
        assert "amplifier_enabled" not in axis.flags
    first = closed.number("#2P")
    closed.sim.wait(0.5)
    assert closed.number("#2P") > first + 100
    closed.sim.wait(30.0)
    assert closed.number("#2V") == 0


def test_control_a_closes_open_loops_as_the_manual_says(bench: Bench) -> None:
    assert not bench.lathe.snapshot().loops_closed
    bench.raw(b"\x01")
    assert bench.lathe.snapshot().loops_closed


def test_control_a_leaves_a_motor_that_is_not_activated_alone(bench: Bench) -> None:
    bench.client.request("I300=0")
    bench.raw(b"\x01")
    assert not bench.sim.controller.motors[3].enabled
    assert bench.sim.controller.motors[1].enabled


def trip(bench: Bench) -> None:
    """Ask the tool for more than its loop can follow: 100 mm/s at once, with a trip of 10 counts."""
    bench.client.request("I111=160 I119=0 I120=1 I121=0 I122=500")
    bench.client.request("#1J+")
    bench.sim.wait(0.2)


def test_a_following_error_beyond_ix11_kills_the_motor_and_says_so(closed: Bench) -> None:
    closed.client.request(f"I{closed.sim.controller.dialect.index(FamilySetting.FLAG_MODE, 1)}=0")
    trip(closed)
    flags = closed.lathe.snapshot().tool.flags
    assert {"fatal_following_error", "open_loop"} <= flags
    assert closed.lathe.snapshot().faults == ("tool: fatal_following_error",)
    assert not closed.sim.controller.motors[2].enabled, "a kill mode of 00 kills all motors"
    closed.client.request("#1J/")
    assert "fatal_following_error" not in closed.lathe.snapshot().tool.flags


def test_the_limit_is_in_sixteenths_of_a_count(closed: Bench) -> None:
    closed.client.request("I311=160")
    carriage = closed.sim.controller.motors[3]
    for error, enabled in ((10.0, True), (-10.0, True), (10.5, False)):
        carriage.desired = carriage.encoder + error
        closed.sim.controller.background()
        assert carriage.enabled is enabled


def test_ix25_may_spare_the_other_motors_but_never_closes_an_open_one(closed: Bench) -> None:
    flags = closed.sim.controller.dialect.index(FamilySetting.FLAG_MODE, 1)
    closed.client.request(f"I{flags}=$400000 #3K")
    trip(closed)
    enabled = [closed.sim.controller.motors[number].enabled for number in (1, 2, 3)]
    assert enabled == [False, True, False]


def test_a_program_ends_with_the_trip_of_one_of_its_motors(closed: Bench) -> None:
    closed.client.request("I111=160")
    closed.program("INC", "TA1 TS0 TM100", "X10000 Y1000", "X10000 Y1000")
    closed.client.request("R")
    closed.sim.wait(0.3)
    snapshot = closed.lathe.snapshot()
    assert not snapshot.program_running
    assert "fatal_following_error" in closed.lathe.snapshot().tool.flags


def test_the_stop_is_a_kill_until_every_loop_is_reported_closed(bench: Bench) -> None:
    bench.lathe.snapshot()
    assert not bench.stop.loops_closed
    bench.stop.stop("hands in the machine")
    bench.sim.wait(0.1)
    assert not any(motor.enabled for motor in bench.sim.controller.motors.values())


def test_the_stop_is_a_kill_when_one_loop_of_three_is_open(closed: Bench) -> None:
    closed.client.request("#3K")
    closed.lathe.snapshot()
    closed.stop.stop("one axis is open")
    closed.stop.repeat()
    closed.sim.wait(0.1)
    assert not any(motor.enabled for motor in closed.sim.controller.motors.values())


def test_the_stop_is_an_abort_while_every_loop_is_closed(closed: Bench) -> None:
    closed.lathe.snapshot()
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    closed.stop.stop("operator")
    closed.settle()
    assert all(closed.sim.controller.motors[number].enabled for number in (1, 2, 3))


def test_what_is_sent_for_each_state_of_the_drives() -> None:
    wire = Wire()
    stop = StopPath(wire)
    stop.loops_closed = True
    stop.stop("closed")
    stop.loops_closed = False
    stop.repeat()
    # An older reply may still say that the loops are closed: after a kill no stop may close them again.
    stop.loops_closed = True
    stop.repeat()
    stop.stop("later")
    assert wire.urgent == [b"\x01", b"\x0b", b"\x0b", b"\x0b"]
    assert wire.sent == []
    assert stop.reason == "closed"
    stop.kill("really")
    assert wire.urgent[-1] == b"\x0b"


def test_with_hands_in_the_machine_a_stop_opens_loops_that_are_said_to_be_closed() -> None:
    wire = Wire()
    stop = StopPath(wire)
    stop.loops_closed = stop.inside_guard = True
    stop.stop("hands")
    stop.inside_guard = False
    stop.stop("they are out, and the kill is still in force")
    assert wire.urgent == [b"\x0b", b"\x0b"]


def test_before_the_drives_were_seen_a_stop_opens_every_loop() -> None:
    wire = Wire()
    StopPath(wire).stop("at once")
    assert wire.urgent == [b"\x0b"]


def test_nothing_that_moves_is_allowed_after_a_stop() -> None:
    stop = StopPath(Wire())
    stop.check()
    stop.stop("first")
    stop.stop("second")
    for _ in range(2):
        with pytest.raises(StoppedError) as stopped:
            stop.check()
        assert stopped.value.problems[0].value == "first"


def test_a_broken_link_does_not_make_the_stop_raise() -> None:
    wire = Wire()
    wire.broken = True
    stop = StopPath(wire)
    stop.stop("cable cut")
    assert stop.reason == "cable cut"


def test_a_stop_does_not_wait_for_a_pending_reply_nor_spoil_it(closed: Bench) -> None:
    """The line is half sent, the stop goes between, the line is finished and answered."""
    closed.lathe.snapshot()
    closed.client.request("#2J+")
    closed.sim.wait(0.3)
    closed.port.receive(b"P1=3 P")
    closed.stop.stop("operator")
    closed.port.receive(b"1\r")
    closed.sim.wait(0.006)
    assert closed.port.take_output() == b"3\r\x06"
    closed.settle()


def test_a_silent_controller_is_a_timeout_and_the_stop_still_goes(closed: Bench) -> None:
    wire = Wire()
    client = PmacClient(wire, closed.sim)
    before = closed.sim.now_s()

    def receive(timeout_s: float) -> bytes:
        closed.sim.wait(timeout_s)
        return b""

    wire.receive = receive  # type: ignore[method-assign]
    with pytest.raises(LinkTimeoutError):
        client.request("P1")
    assert closed.sim.now_s() - before == pytest.approx(2.1, abs=0.1)
    StopPath(wire).stop("silent")
    assert wire.urgent == [b"\x0b"]


def test_a_controller_that_never_falls_silent_does_not_hold_the_client(closed: Bench) -> None:
    wire = Wire()

    def receive(timeout_s: float) -> bytes:
        closed.sim.wait(0.01)
        return b"\x00"

    wire.receive = receive  # type: ignore[method-assign]
    with pytest.raises(LinkError):
        PmacClient(wire, closed.sim).request("P1")


# Jogs of an operator: finite steps, only at rest, only within the travel; the retract only goes outwards.

BACKGROUND_MS = 5.0
LINK_MS = 50.0


def refusal(act: Callable[[], object]) -> Problem:
    with pytest.raises(DriverError) as refused:
        act()
    return refused.value.problems[0]


def overrun_counts(machine: MachineProfile, axis: AxisName) -> float:
    """How far a jog at its speed runs on after a stop."""
    settings = settings_of(machine, axis)
    return (
        settings.stopping_distance(settings.jog_speed, (BACKGROUND_MS + LINK_MS) / 1000.0)
        * settings.counts_per_unit
    )


def places(bench: Bench) -> list[float]:
    return [motor.desired for motor in bench.sim.controller.motors.values()]


def test_steps_add_up_without_an_error(closed: Bench) -> None:
    """The step starts from where the axis is commanded to be, not from where the loop happens to hold it."""
    closed.lathe.home()
    start = closed.sim.controller.motors[1].desired
    for _ in range(5):
        closed.lathe.jog_by(AxisName.TOOL, 7.0)
    assert closed.sim.controller.motors[1].desired - start == pytest.approx(35.0, abs=0.01)
    closed.lathe.jog_by(AxisName.SPINDLE, -2_500.0)
    closed.lathe.jog_by(AxisName.SPINDLE, 2_500.0)
    assert closed.sim.controller.motors[2].desired == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("axis", "counts", "limit"),
    [
        (AxisName.TOOL, -10_010.0, ">= -2.0000 mm"),
        (AxisName.TOOL, 375_010.0, "<= 75.0000 mm"),
        (AxisName.CARRIAGE, -5_010.0, ">= -5.000 mm"),
        (AxisName.CARRIAGE, 199_010.0, "<= 199.000 mm"),
    ],
)
def test_a_step_beyond_the_travel_is_refused(closed: Bench, axis: AxisName, counts: float, limit: str) -> None:
    closed.lathe.home()
    before = places(closed)
    problem = refusal(lambda: closed.lathe.jog_by(axis, counts))
    assert (problem.code, problem.key, problem.limit) == ("machine.beyond_travel", axis, limit)
    closed.sim.wait(0.5)
    assert places(closed) == before


def test_a_rotary_spindle_has_no_end_of_travel(closed: Bench) -> None:
    closed.lathe.jog_by(AxisName.SPINDLE, 30_000.0)
    closed.lathe.jog_by(AxisName.SPINDLE, -60_000.0)
    assert closed.lathe.snapshot().spindle.position == pytest.approx(-30_000, abs=1)


JOGS: list[Callable[[Lathe], None]] = [
    lambda lathe: lathe.jog_by(AxisName.CARRIAGE, 100.0),
    lambda lathe: lathe.retract(-500.0),
]


@pytest.mark.parametrize("jog", JOGS)
def test_a_jog_is_refused_while_something_moves(closed: Bench, jog: Callable[[Lathe], None]) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    assert refusal(lambda: jog(closed.lathe)).code == "machine.moving"
    assert closed.sim.controller.motors[2].velocity > 0, "what moves is not disturbed"


@pytest.mark.parametrize("jog", JOGS)
def test_a_jog_does_not_switch_a_drive_on(bench: Bench, jog: Callable[[Lathe], None]) -> None:
    assert refusal(lambda: jog(bench.lathe)).code == "machine.not_enabled"
    assert not any(motor.enabled for motor in bench.sim.controller.motors.values())


@pytest.mark.parametrize("jog", JOGS)
def test_a_jog_is_refused_after_a_stop(closed: Bench, jog: Callable[[Lathe], None]) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    closed.lathe.snapshot()
    closed.stop.stop("operator")
    with pytest.raises(StoppedError):
        jog(closed.lathe)


def test_the_retract_goes_out_and_never_in(closed: Bench) -> None:
    closed.lathe.home()
    closed.lathe.jog_to(AxisName.TOOL, 20_000.0)
    problem = refusal(lambda: closed.lathe.retract(20_100.0))
    assert (problem.code, problem.key, problem.value) == ("machine.retract_direction", "tool", "4.0200 mm")
    assert closed.lathe.snapshot().tool.position == pytest.approx(20_000, abs=4)
    closed.lathe.retract(10_000.0)
    assert closed.lathe.snapshot().tool.position == pytest.approx(10_000, abs=4)
    # Where it already stands, a count of noise is no reason to complain, nor to move.
    closed.sim.wait(1.0)
    commanded = closed.sim.controller.motors[1].desired
    closed.lathe.retract(10_003.0)
    assert closed.sim.controller.motors[1].desired == commanded


def test_after_a_stop_in_the_part_the_tool_can_be_taken_out(closed: Bench) -> None:
    closed.lathe.home()
    closed.lathe.jog_to(AxisName.TOOL, 5_000.0)
    closed.client.request("#1J=60000")
    closed.sim.wait(0.5)
    closed.lathe.snapshot()
    closed.stop.stop("operator")
    closed.lathe.wait_for_rest()
    closed.stop.release()
    closed.lathe.retract(5_000.0)
    assert closed.lathe.snapshot().tool.position == pytest.approx(5_000, abs=4)


@pytest.mark.parametrize(
    ("axis", "speed", "rate"),
    [(AxisName.TOOL, 50.0, 40.0), (AxisName.SPINDLE, 16.667, 0.5), (AxisName.CARRIAGE, 10.0, 0.5)],
)
def test_the_overrun_is_late_stop_and_ramp(closed: Bench, axis: AxisName, speed: float, rate: float) -> None:
    expected = speed * (BACKGROUND_MS + LINK_MS) + speed**2 / (2 * rate)
    assert overrun_counts(closed.lathe.machine, axis) == pytest.approx(expected)


def test_an_axis_that_never_ramps_down_has_no_end_of_its_overrun(closed: Bench) -> None:
    machine = closed.lathe.machine
    variables = {**machine.controller.variables, "I315": 0.0}
    soft = replace(machine, controller=replace(machine.controller, variables=variables))
    assert overrun_counts(soft, AxisName.CARRIAGE) == float("inf")


@pytest.mark.parametrize("motor", [1, 2, 3])
def test_a_stop_in_mid_jog_runs_on_by_less_than_the_overrun(closed: Bench, motor: int) -> None:
    """The link of the bench is quick: of the 50 ms only those that are waited here are used."""
    closed.client.request(f"#{motor}J+")
    closed.sim.wait(1.0)
    closed.lathe.snapshot()
    pressed = closed.sim.controller.motors[motor].desired
    closed.sim.wait(LINK_MS / 1000.0 - 0.005)
    closed.stop.stop("operator")
    closed.lathe.wait_for_rest()
    went = closed.sim.controller.motors[motor].desired - pressed
    bound = overrun_counts(closed.lathe.machine, list(AxisName)[motor - 1])
    assert 0.8 * bound < went <= bound


def test_loops_that_our_kill_opens_are_nobody_elses_doing(closed: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """The key thread sends it between the decision to look and the look."""
    closed.lathe.home()
    request = closed.client.request

    def with_a_kill(line: str, *more: object, **words: object) -> tuple[str, ...]:
        if line.startswith("#1P") and closed.sim.controller.motors[3].jogging and closed.stop.reason is None:
            closed.stop.kill("F9")
        return request(line, *more, **words)  # type: ignore[arg-type]

    monkeypatch.setattr(closed.client, "request", with_a_kill)
    with pytest.raises(StoppedError, match="F9"):
        closed.lathe.jog_by(AxisName.CARRIAGE, 20_000.0)
