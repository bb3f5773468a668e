"""Clocks, patience and polls: time that runs, is lost or is waited for."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import TrainingClock
from drivers.errors import DriverError, LinkTimeoutError
from drivers.identification.standstill import (
    CONFIRMING_PERIODS,
    LONGEST_WAIT_S,
    Standstill,
    confirming_wait_s,
    detected_within_s,
)
from drivers.lathe.lathe import Lathe
from drivers.lathe.motion import CUT_POLL_S
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS, PMAC, TURBO, Dialect
from drivers.pmac.heartbeat.watchdog import MARGIN_MS, PERIOD_MS, WATCHDOG_MS
from drivers.pmac.program_text import read_program
from drivers.simulator.hosts.port import Port
from drivers.simulator.hosts.real_time import (
    HEARD_S,
    MOST_CATCH_UP_S,
    SLICE_S,
    TICK_S,
    TIMEOUT_S,
    SimulationPace,
    WallClock,
    patient,
    run_clock,
)
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.conftest import Bench, Recorder


class AllOverError(Exception):
    """The clock has run out of ticks."""


class HandClock(WallClock):
    """Wakes up as late as it is told, once for each lateness."""

    def __init__(self, late_s: Iterable[float]) -> None:
        self._late_s = iter(late_s)
        self._now_s = 100.0

    def now_s(self) -> float:
        return self._now_s

    async def sleep(self, seconds: float) -> None:
        if seconds == 0.0:
            return
        late_s = next(self._late_s, None)
        if late_s is None:
            raise AllOverError
        self._now_s += seconds + late_s


class Heard:
    """A lathe that adds up what it is advanced by, and a host that counts how often it is heard."""

    def __init__(self) -> None:
        self.slices_s: list[float] = []
        self.times = 0

    def wait(self, seconds: float) -> None:
        self.slices_s.append(seconds)

    def flush(self) -> None:
        self.times += 1


def run(late_s: list[float], speed: float = 1.0) -> tuple[Heard, list[float]]:
    heard, lags_s = Heard(), list[float]()
    with suppress(AllOverError):
        asyncio.run(run_clock(heard.wait, (heard,), HandClock(late_s), SimulationPace(speed), lags_s))
    return heard, lags_s


@pytest.mark.parametrize("speed", [0.01, 0.5, 1.0, 7.0, 100.0])
def test_simulated_time_runs_as_many_times_as_fast(speed: float) -> None:
    heard, _ = run([0.0, 0.002, 0.0, 0.03] * 50, speed)
    assert sum(heard.slices_s) == pytest.approx(speed * (200 * TICK_S + 50 * 0.032))


@pytest.mark.parametrize("speed", [1.0, 100.0])
def test_hosts_are_heard_after_each_short_slice(speed: float) -> None:
    heard, _ = run([0.0, 0.08] * 5, speed)
    assert max(heard.slices_s) <= SLICE_S
    assert heard.times == len(heard.slices_s)


def test_time_that_is_lost_or_late_is_taken_down() -> None:
    heard, _ = run([0.0, 30.0, 0.0])
    assert sum(heard.slices_s) == pytest.approx(MOST_CATCH_UP_S + 2 * TICK_S)
    late_s = [0.0, 0.001, 0.0, 0.25]
    _, lags_s = run(late_s)
    assert lags_s == pytest.approx(late_s, abs=1e-9)
    # A tick that is some milliseconds late is none of it; one that is 0.5 s late is, at any speed.
    for speed in (1.0, 2.0):
        pace = SimulationPace(speed)
        with suppress(AllOverError):
            asyncio.run(run_clock(Heard().wait, (), HandClock([0.0, 0.004, 0.5, 0.002]), pace))
        assert pace.held_s == pytest.approx(0.5 * speed)


# Machine time of a lathe in training: scaled, paused, never going back.

STEP_S = st.floats(min_value=0.0, max_value=100.0)


class Real:
    """Real time, advanced by hand and by sleeping."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def clock_of(real: Real) -> TrainingClock:
    return TrainingClock(lambda: real.now_s, real.sleep)


@given(st.lists(st.tuples(st.sampled_from((0.0, 0.25, 1.0, 4.0)), STEP_S)))
def test_it_is_the_sum_of_what_passed_at_each_speed(steps: list[tuple[float, float]]) -> None:
    real = Real()
    clock, expected_s, before_s = clock_of(real), 1000.0, 1000.0
    for speed, seconds in steps:
        clock.set_speed(speed)
        real.now_s += seconds
        expected_s += speed * seconds
        assert clock.now_s() == pytest.approx(expected_s)
        assert clock.now_s() >= before_s
        before_s = clock.now_s()


@pytest.mark.parametrize(("speed", "real_s"), [(0.25, 4.0), (1.0, 1.0), (4.0, 0.25)])
def test_a_wait_is_of_machine_time(speed: float, real_s: float) -> None:
    real = Real()
    clock = clock_of(real)
    clock.set_speed(speed)
    before_s = clock.now_s()
    clock.wait(1.0)
    assert clock.now_s() - before_s == pytest.approx(1.0)
    assert real.now_s == pytest.approx(1000.0 + real_s)


def test_a_wait_in_a_pause_ends() -> None:
    real = Real()
    clock = clock_of(real)
    clock.set_speed(0.0)
    clock.wait(1.0)
    assert clock.paused
    assert clock.now_s() == 1000.0


# The simulator of a screen waits for a host that gets no processor, but not for one that is gone.

PATIENCE_TICK_S = 0.005


class Elapsed:
    """A lathe that adds up what it is advanced by."""

    def __init__(self) -> None:
        self.simulated_s = 0.0

    def wait(self, seconds: float) -> None:
        self.simulated_s += seconds


def silence(real_s: float) -> float:
    """Return the simulated time of a host's silence."""
    lathe, now_s = Elapsed(), [0.0]
    wait = patient(lathe.wait, lambda: 0.0, lambda: now_s[0])
    while now_s[0] < real_s:
        now_s[0] += PATIENCE_TICK_S
        wait(PATIENCE_TICK_S)
    return lathe.simulated_s


@pytest.mark.parametrize("real_s", [0.2, 0.3, 1.0, 1.9])
def test_a_lease_outlives_a_host_that_is_held_up(real_s: float) -> None:
    assert silence(real_s) < (WATCHDOG_MS - MARGIN_MS - PERIOD_MS) / 1000.0


@pytest.mark.parametrize("speed", [0.25, 1.0, 2.0, 4.0])
def test_a_lease_outlives_one_input_in_a_few_at_any_speed(speed: float) -> None:
    """Between two renewals there are one or two other inputs, each of them held up."""
    lathe, now_s, heard_s = Elapsed(), [0.0], [0.0]
    wait = patient(lathe.wait, lambda: heard_s[0], lambda: now_s[0], SimulationPace(speed))
    for _ in range(2 if speed > 1.0 else 1):
        heard_s[0] = now_s[0]
        until_s = now_s[0] + 1.0
        while now_s[0] < until_s:
            now_s[0] += PATIENCE_TICK_S
            wait(PATIENCE_TICK_S * speed)
    assert lathe.simulated_s < (WATCHDOG_MS - MARGIN_MS - PERIOD_MS) / 1000.0


def test_who_is_gone_or_has_not_yet_spoken_is_not_waited_for() -> None:
    assert silence(TIMEOUT_S + 1.0) == pytest.approx(HEARD_S + 1.0, abs=3 * PATIENCE_TICK_S)
    lathe = Elapsed()
    patient(lathe.wait, lambda: None, lambda: 1000.0)(PATIENCE_TICK_S)
    assert lathe.simulated_s == PATIENCE_TICK_S


def test_the_time_that_a_lathe_waits_for_its_host_is_counted() -> None:
    lathe, now_s, pace = Elapsed(), [0.0], SimulationPace()
    wait = patient(lathe.wait, lambda: 0.0, lambda: now_s[0], pace)
    while now_s[0] < 1.0:
        now_s[0] += PATIENCE_TICK_S
        wait(PATIENCE_TICK_S)
    assert pace.held_s + lathe.simulated_s == pytest.approx(1.0)
    assert pace.held_s == pytest.approx(1.0 - HEARD_S, abs=3 * PATIENCE_TICK_S)


# Whoever only asks changes nothing: the same motion, number by number, with and without clients.

BLENDED = (
    "LINEAR INC TA20 TS5 TM37 P1=0",
    "WHILE(P1<12)",
    "P1=P1+1",
    "X(10*SIN(P1*30)) Y(P1*7) Z-3",
    "ENDWHILE",
    "DWELL30",
)
EVERYTHING = (*BLENDED, "RAPID Z100", "SPLINE1 TA30 X5 Y80", "X-5 Y80", "LINEAR PVT40 X3:0", "HOME3", "LINEAR X20")

QUESTIONS = (
    b"#1P#2V ? ?? ???\r",
    b"#3PVF I130..135\r",
    b"&1%P1 Q1 M1 LIST PROG 1\r",
    b"#2?#1?&1??\r",
    b"\x02\x03\x06\x07\x10\x16",
    b"PC PE SIZE no such word\r",
)


Tracks = tuple[list[list[float]], list[list[float]]]


def told(machine: MachineProfile, dialect: Dialect, clients: int, program: tuple[str, ...]) -> Tracks:
    """Run a program; return what the motors were told, and where they were, while so many clients poll."""
    sim = SimulatedLathe(machine, dialect=dialect)
    host = sim.connect()
    polling: list[Port] = [sim.connect() for _ in range(clients)]
    recorders = []
    for motor in (1, 2, 3):
        true_position = sim.controller.motors[motor]
        true_position.axis = Recorder(true_position.axis)
        recorders.append(true_position.axis)

    def say(line: str) -> None:
        host.receive(line.encode("ascii") + b"\r")
        sim.wait(0.01)
        assert b"\x07" not in host.take_output(), line

    say("I3=2 I6=1 I119=0 I219=0 I319=0")
    say("#1J/ #2J/ #3J/")
    for line in ("OPEN PROG 1 CLEAR", *program, "CLOSE"):
        say(line)
    say("&1B1R")
    for tick in range(120):
        for place, port in enumerate(polling):
            port.receive(QUESTIONS[(tick + place) % len(QUESTIONS)])
            if place % 2:
                sim.attend(port)
            port.take_output()
        if tick == 20:
            say("&1H")
        elif tick == 60:
            say("&1R")
        elif tick == 80:
            say("&1%70")
        sim.wait(0.01)
    assert not sim.controller.systems[1].motion.runtime_error
    return [recorder.commands for recorder in recorders], [recorder.positions for recorder in recorders]


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)
def test_a_trajectory_is_the_same_with_four_clients_at_100_hz(machine: MachineProfile, dialect: Dialect) -> None:
    alone, polled = (told(machine, dialect, clients, EVERYTHING) for clients in (0, 4))
    assert any(max(track) - min(track) > 100 for track in alone[0])
    assert polled == alone


def test_both_families_move_alike(machine: MachineProfile) -> None:
    """The same settings at the places that each family has for them make the same motion."""
    assert told(machine, TURBO, 0, BLENDED) == told(machine, PMAC, 0, BLENDED)


# Whoever shows the machine sees every look, in whatever wait it was taken, and how long the last one took.

SHORT = "OPEN PROG 3\nCLEAR\nINC\nTA100 TS0 TM1000\nZ1000\nCLOSE\n"


class LateLink(MemoryLink):
    """A link whose answers are late, or do not come at all."""

    late_s = 0.0
    deaf = False

    def receive(self, timeout_s: float) -> bytes:
        data = super().receive(timeout_s)
        if data:
            self._clock.wait(self.late_s)
        return b"" if self.deaf else data


def observed(bench: Bench) -> tuple[LateLink, Lathe, list[Snapshot]]:
    seen: list[Snapshot] = []
    link = LateLink(bench.port, bench.sim)
    lathe = Lathe(PmacClient(link, bench.sim), bench.lathe.machine, bench.sim, StopPath(link), seen.append)
    lathe.connect()
    lathe.verify()
    return link, lathe, seen


def test_every_wait_shows_the_machine_on_its_way(bench: Bench) -> None:
    _, lathe, seen = observed(bench)
    lathe.enable()
    lathe.home()
    assert any("home_search" in s.tool.flags for s in seen)
    assert any("home_search" in s.spindle.flags for s in seen)
    seen.clear()
    lathe.jog_to(AxisName.CARRIAGE, 10_000.0)
    assert [s.carriage.position for s in seen] == sorted(s.carriage.position for s in seen)
    assert any(100 < s.carriage.position < 9_900 and s.moving for s in seen)
    lathe.program.load(read_program(SHORT))
    seen.clear()
    watched: list[Snapshot] = []
    lathe.program.start(3, 0.0)
    last = lathe.program.follow(watched.append, timeout_s=10.0)
    assert seen == watched
    assert seen[-1] is last
    assert not last.moving
    lathe.stop.stop("operator")
    seen.clear()
    assert lathe.wait_for_rest() is seen[-1]
    assert len(seen) >= 3


def test_a_look_that_is_seen_is_the_one_that_is_returned(bench: Bench) -> None:
    _, lathe, seen = observed(bench)
    assert [lathe.snapshot()] == seen


def test_the_round_trip_is_that_of_the_last_look(bench: Bench) -> None:
    link, lathe, _ = observed(bench)
    assert lathe.round_trip_s == 0.0
    lathe.snapshot()
    quick_s = lathe.round_trip_s
    assert 0.0 < quick_s < 0.02, "the card answers in its next background cycle, of 5 ms"
    link.late_s = 0.2
    lathe.snapshot()
    assert lathe.round_trip_s == pytest.approx(quick_s + 0.2, abs=0.02)


def test_a_look_that_fails_shows_nothing_and_keeps_the_last_round_trip(bench: Bench) -> None:
    link, lathe, seen = observed(bench)
    lathe.snapshot()
    before_s = lathe.round_trip_s
    link.deaf = True
    with pytest.raises(LinkTimeoutError):
        lathe.snapshot()
    assert len(seen) == 1
    assert lathe.round_trip_s == before_s


# A healthy tool at a turning point is no tool that does not respond, however coarse the controller answers.

MACHINE = load_machine("lee-2001-lathe").machine

MOVING = ((50.0, -40.0, 0.0), (-60.0, 40.0, 0.0))
"""What confirms the first poll: the tool moves."""


class Card:
    """Answers the confirming polls: position, following error and velocity word, one after the other."""

    def __init__(self, *answers: tuple[float, float, float]) -> None:
        self.killed: list[str] = []
        given_answers = iter(answers)
        self.rig = cast(
            Any,
            SimpleNamespace(
                machine=MACHINE,
                dialect=DIALECTS["pmac"],
                where="",
                clock=SimpleNamespace(wait=lambda seconds: None),
                client=SimpleNamespace(numbers=lambda *items, again: next(given_answers)),
                lathe=SimpleNamespace(stop=SimpleNamespace(kill=self.killed.append)),
            ),
        )


def poll(position: float, command: float) -> Any:
    return SimpleNamespace(tool=SimpleNamespace(position=position, following_error=command - position))


def seen(card: Card, *polls: tuple[float, float]) -> None:
    watch = Standstill(card.rig, 210.0, 35.0)
    for position, command in polls:
        watch.see(poll(position, command))


def test_confirming_polls_must_show_another_cycle_and_a_stuck_reading_is_told() -> None:
    """As seen at 210 Hz: two polls near a turning point, and twice the second of them again."""
    card = Card(*MOVING, (29.0, -229.405, 0.0), (29.0, -229.405, 0.0))
    seen(card, (90.0, 20.0), (28.0, -135.967), (29.0, -200.405))
    assert card.killed == []
    card = Card(*MOVING, (29.0, 90.0, 0.0), (29.0, -120.0, 0.0))
    with pytest.raises(DriverError) as told:
        seen(card, (90.0, 20.0), (28.0, -135.967), (29.0, -200.405))
    assert (told.value.problems[0].code, card.killed) == ("identify.no_motion", ["identify.no_motion"])


@given(st.floats(0.5, 400.0), st.sampled_from(CONFIRMING_PERIODS), st.floats(0.001, 0.01))
def test_it_waits_a_background_cycle_and_keeps_the_phase(hz: float, periods: float, background_s: float) -> None:
    """Or, where that takes too long, it waits no whole period: a wait that is cut short has lost its phase."""
    wait_s = confirming_wait_s(periods, hz, background_s)
    assert wait_s <= LONGEST_WAIT_S
    whole = wait_s * hz - periods
    if whole >= 0.5:
        assert wait_s >= background_s * (1.0 - 1e-9)
    if wait_s < LONGEST_WAIT_S:
        assert whole == pytest.approx(round(whole), abs=1e-9)


class FrozenCard(Card):
    """Answers once per background cycle; its command swings on, and its reading stands."""

    def __init__(self, hz: float, began_s: float, round_trip_s: float) -> None:
        super().__init__()
        self._hz, self._round_trip_s = hz, round_trip_s
        self._cycle_s, self._counts = 11e-3 * MACHINE.controller.servo_period_ms, 35.0 / MACHINE.tool.count_um
        self.now_s = began_s
        self.rig.clock.wait, self.rig.client.numbers = self.wait, self.answer

    def wait(self, seconds: float) -> None:
        self.now_s += seconds

    def answer(self, *items: str, again: bool = True) -> tuple[float, float, float]:
        self.wait(self._round_trip_s)
        latched_s = math.floor(self.now_s / self._cycle_s + 1e-9) * self._cycle_s
        return 7.0, self._counts * math.sin(2.0 * math.pi * self._hz * latched_s) - 7.0, 0.0


@pytest.mark.parametrize("round_trip_s", [0.0005, 0.003])
@pytest.mark.parametrize("hz", [10.0, 37.0, 46.5, 50.0, 50.2, 51.3, 62.5, 81.0, 120.0, 187.5, 225.0])
def test_a_frozen_reading_is_detected_in_time_whatever_the_phase(hz: float, round_trip_s: float) -> None:
    for eighth in range(8):
        began_s = eighth / 8 / hz
        card = FrozenCard(hz, began_s, round_trip_s)
        watch = Standstill(card.rig, hz, 35.0)
        with pytest.raises(DriverError):
            while card.now_s < began_s + 3.0:
                position, error, _ = card.answer()
                watch.see(poll(position, position + error))
                card.wait(CUT_POLL_S)
        assert card.now_s - began_s <= detected_within_s(round_trip_s)
