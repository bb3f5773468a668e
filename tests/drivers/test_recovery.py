"""Stops, proofs of rest, and the way back to work."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from types import CodeType, FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DriverError, LinkError
from drivers.lathe.guards import ProgramGuard
from drivers.lathe.snapshot import AxisName
from drivers.lathe.standstill import STUDENT_T, drift_and_scatter, rest_is_proven, rest_limits
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.base import StopWay
from drivers.pmac.program_text import read_program
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from profiles.problem import Problem
from tests.drivers.conftest import Bench, TrueBenchMaker
from tests.drivers.families import machine as machine
from tests.drivers.test_path_seen import LENGTHS, seen, state

SLOW = "OPEN PROG 3\nCLEAR\nINC\nTA100 TS0 TM60000\nZ60000\nCLOSE\n"
FAULTY = "OPEN PROG 3\nCLEAR\nINC\nTA1 TS0 TM100\nZ10\nP(0-1)=1\nCLOSE\n"


class Wire:
    """A link that only writes down which stops are sent."""

    address = "wire"
    stop_way = StopWay.DIRECT
    checks_bytes = True

    def __init__(self) -> None:
        self.urgent: list[bytes] = []
        self.meanwhile: Callable[[], None] = lambda: None

    def send(self, data: bytes) -> None: ...

    def receive(self, timeout_s: float) -> bytes:
        return b""

    def send_urgent(self, data: bytes) -> None:
        self.meanwhile()
        self.urgent.append(data)

    def close(self) -> None: ...


def refusal(act: Callable[[], object]) -> Problem:
    with pytest.raises(DriverError) as refused:
        act()
    return refused.value.problems[0]


def stopped_and_proven() -> tuple[Wire, StopPath]:
    wire = Wire()
    stop = StopPath(wire)
    stop.loops_closed = True
    stop.stop("first")
    mark = stop.mark
    assert mark is not None
    stop.rest_proven(mark)
    return wire, stop


@contextmanager
def interrupted(code: CodeType, instant: int, act: Callable[[], None]) -> Iterator[list[int]]:
    """Do something before the instruction number `instant` of a function, as a signal or another thread might."""
    reached = [0]

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        if frame.f_code is not code:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            reached[0] += 1
            if reached[0] == instant:
                sys.settrace(None)
                act()
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield reached
    finally:
        sys.settrace(before)


def instructions(code: CodeType, act: Callable[[], object]) -> int:
    with interrupted(code, -1, lambda: None) as reached:
        act()
    return reached[0]


@pytest.mark.parametrize("kill", [False, True])
def test_a_stop_at_any_instant_of_a_release_stays_in_force(kill: bool) -> None:
    code = StopPath.release.__code__
    count = instructions(code, stopped_and_proven()[1].release)
    assert count > 10
    for instant in range(1, count + 1):
        wire, stop = stopped_and_proven()
        press = stop.kill if kill else stop.stop
        with interrupted(code, instant, lambda press=press: press("late")), suppress(DriverError):  # type: ignore[misc]
            stop.release()
        assert len(wire.urgent) == 2, "it was sent"
        assert not stop.proven
        assert stop.killed or not kill
        with pytest.raises(StoppedError):
            stop.check()
        assert refusal(stop.release).code == "stop.not_proven"


@pytest.mark.parametrize("kill", [False, True])
def test_a_release_at_any_instant_of_a_stop_does_not_take_it_back(kill: bool) -> None:
    code = StopPath._send.__code__
    fresh = stopped_and_proven()[1]
    count = instructions(code, lambda: fresh.stop("late"))

    def proof_and_release(stop: StopPath) -> None:
        mark = stop.mark
        if mark is not None:
            stop.rest_proven(mark)
        with suppress(DriverError):
            stop.release()

    for instant in range(1, count + 1):
        wire, stop = stopped_and_proven()
        press = stop.kill if kill else stop.stop
        with interrupted(code, instant, lambda stop=stop: proof_and_release(stop)):  # type: ignore[misc]
            press("late")
        sent = stop.mark == len(wire.urgent) == 2
        assert sent
        over = stop.reason is None
        # Released it may only be when it had gone out before the proof began: in the last instructions.
        assert not over or instant > count - 6
        assert over or stop.killed is (wire.urgent[-1] == b"\x0b")


def test_no_proof_begins_while_a_stop_is_on_its_way() -> None:
    wire, stop = stopped_and_proven()
    marks: list[int | None] = []
    wire.meanwhile = lambda: marks.append(stop.mark)
    stop.stop("second")
    assert marks == [None]
    assert stop.mark == 2


def test_a_release_forgets_the_stop_and_knows_nothing_of_the_drives() -> None:
    wire, stop = stopped_and_proven()
    stop.kill("really")
    assert (stop.reason, stop.killed, stop.proven) == ("first", True, False)
    assert refusal(stop.release).code == "stop.not_proven"
    stop.rest_proven(2)
    assert stop.proven
    stop.loops_closed = True
    stop.release()
    assert (stop.reason, stop.killed, stop.loops_closed, stop.proven) == (None, False, False, False)
    stop.check()
    stop.release()
    stop.stop("nothing is known of the drives")
    assert wire.urgent[-1] == b"\x0b"
    assert stop.reason == "nothing is known of the drives"


def test_a_stop_sent_again_asks_for_a_new_proof() -> None:
    _, stop = stopped_and_proven()
    stop.repeat()
    assert not stop.proven
    assert refusal(stop.release).code == "stop.not_proven"


@pytest.mark.parametrize("kill", [False, True])
def test_after_a_proven_stop_the_machine_works_again(closed: Bench, kill: bool) -> None:
    lathe, stop = closed.lathe, closed.stop
    lathe.program.load(read_program(SLOW))
    lathe.program.start(3, 0.0)
    closed.sim.wait(0.5)
    lathe.snapshot()
    (stop.kill if kill else stop.stop)("operator")
    assert refusal(stop.release).code == "stop.not_proven"
    lathe.wait_for_rest()
    assert stop.proven
    stop.release()
    assert not stop.loops_closed
    snapshot = lathe.snapshot()
    assert stop.loops_closed is snapshot.loops_closed is not kill
    lathe.enable()
    lathe.home()
    lathe.jog_to(AxisName.CARRIAGE, 2_000.0)
    assert lathe.snapshot().carriage.position == pytest.approx(2_000, abs=1)


def test_a_stop_pressed_while_rest_is_proven_begins_the_proof_anew(closed: Bench) -> None:
    """The press comes from another thread between the looks; after it the spindle runs out, killed."""
    looks = 0
    original = closed.sim.wait

    def wait(seconds: float) -> None:
        nonlocal looks
        looks += seconds == pytest.approx(0.2)
        if looks == 2 and not closed.stop.killed:
            thread = threading.Thread(target=closed.stop.kill, args=("second thoughts",))
            thread.start()
            thread.join()
        original(seconds)

    closed.stop.stop("operator")
    closed.sim.wait = wait  # type: ignore[method-assign]
    assert closed.lathe.wait_for_rest().loops_open
    assert closed.stop.proven
    assert looks >= 4, "three looks after the press"


def test_a_stop_pressed_during_the_last_look_of_a_proof_is_not_proven_by_it(closed: Bench) -> None:
    answers: list[bool] = []

    def press(_: object) -> None:
        answers.append(closed.stop.proven)
        if len(answers) == 4:
            closed.stop.stop("at the last moment")

    closed.stop.stop("operator")
    closed.lathe._poller._seen = press
    closed.lathe.wait_for_rest()
    assert len(answers) == 7, "the fourth look would have been the last"
    assert closed.stop.proven


def test_a_stop_after_the_proof_must_be_proven_itself(closed: Bench) -> None:
    closed.stop.stop("operator")
    closed.lathe.wait_for_rest()
    closed.stop.stop("once more")
    assert refusal(closed.stop.release).code == "stop.not_proven"
    with pytest.raises(StoppedError):
        closed.lathe.jog_to(AxisName.TOOL, 10.0)


def test_a_program_that_ended_with_an_error_does_not_keep_the_axes_from_jogging(closed: Bench) -> None:
    """Its error bit stays set until the next program is started."""
    lathe = closed.lathe
    lathe.program.load(read_program(FAULTY))
    lathe.program.start(3, 0.0)
    assert refusal(lambda: lathe.program.follow(lambda snapshot: None, 10.0)).code == "machine.fault"
    lathe.wait_for_rest()
    closed.stop.release()
    assert lathe.snapshot().faults == ("program: runtime_error",)
    lathe.enable()
    lathe.jog_to(AxisName.CARRIAGE, 500.0)
    assert lathe.snapshot().carriage.position == pytest.approx(500, abs=1)


def test_switching_off_opens_all_loops_and_is_no_stop(closed: Bench) -> None:
    closed.lathe.snapshot()
    closed.lathe.switch_off()
    assert not any(motor.enabled for motor in closed.sim.controller.motors.values())
    assert (closed.stop.reason, closed.stop.killed, closed.stop.loops_closed) == (None, False, False)
    closed.stop.stop("hands in the machine")
    closed.sim.wait(0.1)
    assert not any(motor.enabled for motor in closed.sim.controller.motors.values()), "a kill, not an abort"
    closed.lathe.wait_for_rest()
    closed.stop.release()
    assert refusal(closed.lathe.enable).code == "machine.hands_in"
    assert not any(motor.enabled for motor in closed.sim.controller.motors.values())
    closed.lathe.confirm_nobody_inside()
    closed.lathe.enable()
    assert closed.lathe.snapshot().loops_closed


def test_switching_off_is_refused_while_something_moves(closed: Bench) -> None:
    closed.client.request("#2J+")
    closed.sim.wait(0.5)
    assert refusal(closed.lathe.switch_off).code == "machine.moving"
    assert closed.lathe.snapshot().loops_closed


def test_drives_that_stay_on_are_told(closed: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed.client.link, "send_urgent", lambda data: None)
    assert refusal(closed.lathe.switch_off).code == "machine.not_switched_off"


def test_drives_cannot_be_switched_off_over_a_broken_link(closed: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(data: bytes) -> None:
        raise LinkError(Problem(code="link.lost"))

    monkeypatch.setattr(closed.client.link, "send_urgent", broken)
    assert refusal(closed.lathe.switch_off).code == "link.lost"


# When a machine counts as at rest: soon where it rests, whatever noise its scales have, never where it moves.

LIMITS = rest_limits(LENGTHS.machine)
POLL_S = 0.2
NOISE = [0.0, 0.75, 1.5, 3.0]
"""Of the tool's scale, counts rms: 1.5 are 0.3 um of a scale with counts of 0.2 um."""


def proven_after_s(seed: int, noise: float, place: Callable[[float], float]) -> float | None:
    """Return when rest is proven of a tool at a place that depends on time, within the 15 s that a stop allows."""
    chance = np.random.default_rng(seed)
    looks = []
    for at_s in np.arange(0.0, 15.0, POLL_S):
        position = round(place(at_s) + noise * chance.standard_normal(), 1)
        looks.append(seen(float(at_s), tool=state(position)))
        if rest_is_proven(looks, LIMITS):
            return float(at_s)
    return None


@pytest.mark.parametrize("noise", NOISE)
def test_rest_is_proven_within_seconds_whatever_the_noise(noise: float) -> None:
    found = [proven_after_s(seed, noise, lambda _: 17.3) for seed in range(40)]
    slowest = max(15.0 if each is None else each for each in found)
    assert slowest <= (0.61 if noise == 0.0 else 4.0)


@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("counts_per_s", [-200.0, 20.0])
def test_an_axis_that_moves_is_not_at_rest(noise: float, counts_per_s: float) -> None:
    """20 counts/s are 4 um/s of the tool, and 0.12 rpm of the spindle."""
    assert [proven_after_s(seed, noise, lambda at_s: counts_per_s * at_s) for seed in range(20)] == [None] * 20


@pytest.mark.parametrize("noise", [1.5, 3.0])
def test_a_lucky_look_in_fifteen_seconds_hardly_ever_calls_a_slow_drift_rest(noise: float) -> None:
    """10 counts/s are twice the limit, and below the noise from poll to poll."""
    found = [proven_after_s(seed, noise, lambda at_s: 10.0 * at_s) for seed in range(100)]
    assert sum(each is not None for each in found) <= 2


@pytest.mark.parametrize("frequency_hz", [0.5, 1.3, 2.4, 4.4, 7.7, 12.3, 26.0, 40.0])
def test_an_axis_that_swings_is_not_at_rest(frequency_hz: float) -> None:
    """By 50 counts about one place: a loop that hunts. Its mean drift is none.

    Not told: one that swings in step with the polls, to a hundredth of a second.
    """
    chance = np.random.default_rng(7)
    for _ in range(10):
        phase = chance.uniform(0.0, 2 * np.pi)
        late_s = iter(chance.uniform(0.0, 0.01, 80))

        def place(at_s: float, phase: float = phase, late_s: Iterator[float] = late_s) -> float:
            return 50.0 * float(np.sin(2 * np.pi * frequency_hz * (at_s + next(late_s)) + phase))

        assert proven_after_s(1, 0.0, place) is None


def test_one_axis_that_moves_is_enough() -> None:
    looks = [seen(POLL_S * n, carriage=state(100.0 * n)) for n in range(12)]
    assert not rest_is_proven(looks, LIMITS)
    assert not rest_is_proven(looks[:1] * 12, LIMITS), "one look that is shown twelve times proves nothing"


@given(
    positions=st.lists(st.integers(-100_000, 100_000), min_size=4, max_size=12),
    late_s=st.lists(st.floats(0.0, 0.1), min_size=12, max_size=12),
)
def test_the_bound_is_that_of_linear_regression(positions: list[int], late_s: list[float]) -> None:
    from scipy.stats import t as student

    times_s = [POLL_S * number + late for number, late in zip(range(len(positions)), late_s, strict=False)]
    (slope, _), covariance = np.polyfit(times_s, positions, 1, cov=True)
    expected = abs(slope) + student.ppf(0.975, len(positions) - 2) * np.sqrt(max(covariance[0, 0], 0.0))
    assert drift_and_scatter(times_s, positions)[0] == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_the_bound_is_that_of_regression_with_the_quantiles_of_student() -> None:
    from scipy.stats import t as student

    assert STUDENT_T == pytest.approx(student.ppf(0.975, np.arange(2, 11)), abs=5e-4)


def test_a_stop_of_a_lathe_with_a_noisy_scale_is_proven_in_seconds(
    machine: MachineProfile, bench_with: TrueBenchMaker
) -> None:
    made = bench_with(replace(ideal(machine), encoder_noise_um=0.3))
    made.lathe.enable()
    for _ in range(5):
        made.stop.stop("operator")
        began_s = made.sim.now_s()
        made.lathe.wait_for_rest()
        assert made.sim.now_s() - began_s < 4.0
        made.stop.release()


@pytest.mark.parametrize("poll_s", [0.05, 0.2, 0.34])
@pytest.mark.parametrize("noise", NOISE)
def test_a_program_on_a_noisy_scale_that_is_held_is_stalled(noise: float, poll_s: float) -> None:
    """It is the only thing that tells of a spindle at standstill, where the program follows the spindle."""
    for seed in range(10):
        chance = np.random.default_rng(seed)
        guard = ProgramGuard(LENGTHS, real_time=False)
        places = noise * chance.standard_normal(round(8.0 / poll_s))
        told = [guard(seen(poll_s * n, tool=state(round(at, 1)))) for n, at in enumerate(places)]
        first = next(n for n, problems in enumerate(told) if problems)
        assert 1.0 <= poll_s * first <= (1.4 if noise == 0.0 else 6.0)


def test_a_fine_scale_has_its_noise_in_more_counts() -> None:
    """0.3 um are 6 counts of 0.05 um: such an axis comes to rest as well."""
    tool = replace(LENGTHS.machine.tool, counts_per_mm=20_000.0)
    limits = rest_limits(replace(LENGTHS.machine, tool=tool))
    chance = np.random.default_rng(5)
    looks = [seen(POLL_S * n, tool=state(6.0 * chance.standard_normal())) for n in range(12)]
    assert rest_is_proven(looks, limits) and not rest_is_proven(looks, LIMITS)
